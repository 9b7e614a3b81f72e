from setuptools import find_packages, setup

setup(
    name="vergence_rig",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/vergence_rig"]),
        ("share/vergence_rig", ["package.xml", "LICENSE", "CHANGELOG.rst"]),
    ],
    package_data={"vergence_rig": ["py.typed"]},
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},  # colcon test runs pytest only where this says so
    zip_safe=True,
    maintainer="Vergence maintainers",
    maintainer_email="vergence-maintainers@example.org",
    description="Description, geometry, cameras and servo plants of the rig, and declared parameters, without ROS.",
    license="Apache-2.0",
)
