from setuptools import find_packages, setup

setup(
    name="vergence_web",
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/vergence_web"]),
        ("share/vergence_web", ["package.xml", "LICENSE", "CHANGELOG.rst"]),
    ],
    package_data={"vergence_web": ["py.typed", "page/*.*", "page/modules/*.js"]},
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},  # colcon test runs pytest only where this says so
    zip_safe=False,
    maintainer="Vergence maintainers",
    maintainer_email="vergence-maintainers@example.org",
    description="A page of the running head: both eyes live, where to look by click, charts, parameters.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "web_node = vergence_web.executables:web_node",
        ]
    },
)
