from glob import glob

from setuptools import find_packages, setup

setup(
    name="vergence_bringup",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/vergence_bringup"]),
        ("share/vergence_bringup", ["package.xml", "LICENSE", "CHANGELOG.rst"]),
        ("share/vergence_bringup/config", [path for path in glob("config/*.*") if not path.endswith("~")]),
        ("share/vergence_bringup/config/security", glob("config/security/*")),
        ("share/vergence_bringup/launch", glob("launch/*.launch.py")),
        ("bin", ["scripts/vergence"]),  # colcon puts this folder on the PATH
        ("share/vergence_bringup/systemd", glob("systemd/*")),
        ("share/vergence_bringup/urdf", glob("urdf/*")),
        ("share/vergence_bringup/mjcf", glob("mjcf/*")),
    ],
    package_data={"vergence_bringup": ["py.typed"]},
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},  # colcon test runs pytest only where this says so
    zip_safe=True,
    maintainer="Vergence maintainers",
    maintainer_email="vergence-maintainers@example.org",
    description="Launch files, URDF, the vergence command line, demo and report.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "vergence = vergence_bringup.command_line:main",
            "head_node = vergence_bringup.executables:head_node",
        ]
    },
)
