from setuptools import find_packages, setup

setup(
    name="vergence",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/vergence"]),
        ("share/vergence", ["package.xml", "LICENSE", "CHANGELOG.rst"]),
    ],
    package_data={"vergence": ["py.typed"]},
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},  # colcon test runs pytest only where this says so
    zip_safe=True,
    maintainer="Vergence maintainers",
    maintainer_email="vergence-maintainers@example.org",
    description="The binocular head in Python without ROS: look at a pixel, step, measure.",
    license="Apache-2.0",
)
