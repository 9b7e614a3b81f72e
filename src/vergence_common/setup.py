from setuptools import find_packages, setup

setup(
    name="vergence_common",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/vergence_common"]),
        ("share/vergence_common", ["package.xml", "LICENSE", "CHANGELOG.rst"]),
    ],
    package_data={"vergence_common": ["py.typed"]},
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},  # colcon test runs pytest only where this says so
    zip_safe=True,
    maintainer="Vergence maintainers",
    maintainer_email="vergence-maintainers@example.org",
    description="What every node shares: conversion of images, parameters, diagnostics, QoS and the main function.",
    license="Apache-2.0",
)
