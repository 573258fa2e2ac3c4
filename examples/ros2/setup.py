"""The ROS 2 package, as colcon builds it."""

from setuptools import setup

setup(
    name="soil_estimator",
    version="0.2.0",
    packages=["soil_estimator"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/soil_estimator"]),
        ("share/soil_estimator", ["package.xml"]),
        ("share/soil_estimator/config", ["config/wheel.yaml"]),
    ],
    install_requires=["setuptools", "soilml"],
    entry_points={
        "console_scripts": [
            "soil_estimator = soil_estimator.node:main",
            "slip_speed = soil_estimator.slip_node:main",
        ]
    },
)
