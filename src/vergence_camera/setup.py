from setuptools import find_packages, setup

setup(
    name="vergence_camera",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/vergence_camera"]),
        ("share/vergence_camera", ["package.xml", "LICENSE", "CHANGELOG.rst"]),
    ],
    package_data={"vergence_camera": ["py.typed"]},
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},  # colcon test runs pytest only where this says so
    zip_safe=True,
    maintainer="Vergence maintainers",
    maintainer_email="vergence-maintainers@example.org",
    description="A USB camera, an MJPEG stream or a recording as topics; two instances make the pair.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "camera_node = vergence_camera.executables:camera_node",
            "list_cameras = vergence_camera.executables:list_cameras",
        ]
    },
)
