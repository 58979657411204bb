"""Installation by pip; what colcon needs stands in package.xml."""

from glob import glob

from setuptools import find_packages, setup

NAME = 'mechanism_sim'
PACKAGES = NAME, 'ros_interfaces', 'zenoh_rclpy'
NODES = (
    'crank_drive', 'linkage', 'cam', 'gear_train', 'geneva', 'oscillator', 'sensors',
    'display', 'recorder',
)  # fmt: skip
OUTSIDE = 'control_relay', 'loop_relay', 'view'

setup(
    packages=find_packages(
        include=[f'{name}{below}' for name in PACKAGES for below in ('', '.*')]
    ),
    package_data={
        **{name: ['py.typed'] for name in PACKAGES},
        NAME: ['py.typed', '*.pyi', 'pages/assets/*', 'editor/assets/*'],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/config', sorted([*glob('config/*.yaml'), 'config/scenes.tsv'])),
        (f'share/{NAME}/config/sweeps', sorted(glob('config/sweeps/*.yaml'))),
        (f'share/{NAME}/msg', sorted(glob('msg/*.msg'))),
    ],
    entry_points={
        'console_scripts': [
            'mechanism-sim = mechanism_sim.__main__:main',
            'zros = zenoh_rclpy.__main__:main',
            *(f'{node} = mechanism_sim.__main__:node' for node in (*NODES, *OUTSIDE)),
        ]
    },
)
