from pathlib import Path

from setuptools import find_packages, setup

package = "digit_driver"

setup(
    name=package,
    version="0.1.0",
    # Named, although it is the default: editable installs then put this folder on sys.path, ahead of
    # the namespace package that the folder of the same name is when Python runs in the workspace root.
    package_dir={"": "."},
    packages=find_packages(exclude=["test", "test.*"]),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
        *(
            (f"share/{package}/{folder}", [str(path) for path in sorted(Path(folder).glob("*.*"))])
            for folder in ("config", "launch", "udev")
        ),
    ],
    install_requires=[
        "midastouch_common",
        "numpy",
        "opencv-contrib-python-headless",
        "PyYAML",
    ],
    package_data={package: ["cameras/*.yaml"]},
    python_requires=">=3.10",
    maintainer="MidasTouch for ROS 2 maintainers",
    maintainer_email="maintainers@example.org",
    description="Driver of the DIGIT tactile sensor.",
    license="MIT",
    extras_require={"test": ["pytest"]},
    entry_points={
        "console_scripts": [
            "digit_driver = digit_driver.executables:digit_driver",
        ]
    },
)
