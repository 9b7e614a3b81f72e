from setuptools import find_packages, setup

setup(
    name="vergence_calibration",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/vergence_calibration"]),
        ("share/vergence_calibration", ["package.xml", "LICENSE", "CHANGELOG.rst"]),
    ],
    package_data={"vergence_calibration": ["py.typed"]},
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},  # colcon test runs pytest only where this says so
    zip_safe=True,
    maintainer="Vergence maintainers",
    maintainer_email="vergence-maintainers@example.org",
    description="Calibration of servos and identification of a running head, by hand or by vision.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "calibrate_servos = vergence_calibration.executables:calibrate_servos",
        ]
    },
)
