from setuptools import find_packages, setup

setup(
    name="vergence_servo",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/vergence_servo"]),
        ("share/vergence_servo", ["package.xml"]),
    ],
    package_data={"vergence_servo": ["py.typed"]},
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="Vergence maintainers",
    maintainer_email="maintainers@users.noreply.h-seed-7aee7c35.example",
    description="Metrics to servos: the gaze control law and the servo drivers.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "gaze_controller_node = vergence_servo.gaze_controller_node:main",
            "servo_node = vergence_servo.servo_node:main",
            "calibrate_servos = vergence_servo.calibrate_servos:main",
        ]
    },
)
