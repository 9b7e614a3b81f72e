from setuptools import find_packages, setup

setup(
    name="vergence_gaze",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/vergence_gaze"]),
        ("share/vergence_gaze", ["package.xml", "LICENSE", "CHANGELOG.rst"]),
    ],
    package_data={"vergence_gaze": ["py.typed"]},
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},  # colcon test runs pytest only where this says so
    zip_safe=True,
    maintainer="Vergence maintainers",
    maintainer_email="vergence-maintainers@example.org",
    description="From metrics to joint commands: goals, estimation of the target, control laws.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "gaze_controller_node = vergence_gaze.executables:gaze_controller_node",
        ]
    },
)
