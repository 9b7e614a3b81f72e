from setuptools import find_packages, setup

setup(
    name="vergence_servo",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/vergence_servo"]),
        ("share/vergence_servo", ["package.xml", "LICENSE", "CHANGELOG.rst"]),
    ],
    package_data={"vergence_servo": ["py.typed"]},
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},  # colcon test runs pytest only where this says so
    zip_safe=True,
    maintainer="Vergence maintainers",
    maintainer_email="vergence-maintainers@example.org",
    description="Joint commands to servo pulses within limits: drivers, guardian, servo_node; for a Pi.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "servo_node = vergence_servo.executables:servo_node",
        ]
    },
)
