from setuptools import find_packages, setup

setup(
    name="vergence_sim",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/vergence_sim"]),
        ("share/vergence_sim", ["package.xml", "LICENSE", "CHANGELOG.rst"]),
    ],
    package_data={"vergence_sim": ["py.typed"]},
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},  # colcon test runs pytest only where this says so
    zip_safe=True,
    maintainer="Vergence maintainers",
    maintainer_email="vergence-maintainers@example.org",
    description="A simulated head in a furnished room or before a photograph, in place of a real one.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "photo_node = vergence_sim.executables:photo_node",
            "sim_node = vergence_sim.executables:sim_node",
        ]
    },
)
