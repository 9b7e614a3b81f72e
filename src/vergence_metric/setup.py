from setuptools import find_packages, setup

setup(
    name="vergence_metric",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/vergence_metric"]),
        ("share/vergence_metric", ["package.xml", "LICENSE", "CHANGELOG.rst"]),
    ],
    package_data={"vergence_metric": ["py.typed", "models/*.onnx", "models/*.md"]},
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},  # colcon test runs pytest only where this says so
    zip_safe=True,
    maintainer="Vergence maintainers",
    maintainer_email="vergence-maintainers@example.org",
    description="Vergence metrics, disparity, class-free tracker and the eyes' rotation, from synchronised pairs.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "edge_metric_node = vergence_metric.executables:edge_metric_node",
            "box_metric_node = vergence_metric.executables:box_metric_node",
            "eye_rotation_node = vergence_metric.executables:eye_rotation_node",
            "stereo_node = vergence_metric.executables:stereo_node",
        ]
    },
)
