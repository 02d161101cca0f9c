from xml.etree import ElementTree

from setuptools import find_packages, setup

package = "midastouch_benchmark"
manifest = ElementTree.parse("package.xml")

setup(
    name=package,
    version=manifest.findtext("version"),
    # Named, although it is the default: editable installs then put this folder on sys.path, ahead of
    # the namespace package that the folder of the same name is when Python runs in the workspace root.
    package_dir={"": "."},
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={package: ["evidence/*.npz", "py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
    ],
    install_requires=[
        "matplotlib",
        "midastouch_bringup",
        "midastouch_common",
        "midastouch_filter",
        "midastouch_kernels",
        "midastouch_motion",
        "midastouch_perception",
        "midastouch_simulation",
        "midastouch_tools",
        "numpy",
        "opencv-contrib-python-headless",
        "pandas",
        "pillow",
        "scipy",
        "tabulate",
        "trimesh",
    ],
    python_requires=">=3.10",
    maintainer=manifest.findtext("maintainer"),
    maintainer_email=manifest.find("maintainer").get("email"),
    description=manifest.findtext("description"),
    license=manifest.findtext("license"),
    extras_require={"cluster": ["distributed"], "test": ["hypothesis", "pytest"]},
    # found by the `midastouch` command of midastouch_tools
    entry_points={
        "midastouch.commands": [
            "bench = midastouch_benchmark.commands.bench",
            "benchmark = midastouch_benchmark.commands.benchmark",
            "campaigns = midastouch_benchmark.commands.campaigns",
            "evaluate = midastouch_benchmark.commands.evaluate",
            "evaluate_perception = midastouch_benchmark.commands.evaluate_perception",
            "evidence = midastouch_benchmark.commands.evidence",
            "report = midastouch_benchmark.commands.report",
            "single_touch = midastouch_benchmark.commands.single_touch",
        ]
    },
)
