"""Configuration of a process's session in the network, and of a router of its own.

The values are those of ``rmw_zenoh_cpp`` (``DEFAULT_RMW_ZENOH_SESSION_CONFIG.json5``) but for what
is said here. Everything listens on loopback only. The environment has the last word:

- ``MECHANISM_SIM_ROUTER``: where the router is, ``tcp/127.0.0.1:7447`` by default;
- ``ROS_DOMAIN_ID``, ``ROS_DISTRO``: as in ROS (the latter for Humble, which has no type hashes);
- ``ZENOH_SESSION_CONFIG_URI``, ``ZENOH_ROUTER_CONFIG_URI``: files that replace these defaults;
- ``ZENOH_CONFIG_OVERRIDE``: ``key=json5;key=json5`` on top of the session's configuration;
- ``ZENOH_ROUTER_CHECK_ATTEMPTS``: how often to look for a router, once a second, before opening
  one; 0 waits for ever, a negative number neither looks nor opens.
"""

import json
import os
import socket
from typing import Any

import zenoh

from zenoh_rclpy.errors import InvalidSettingError

LOOPBACK = 'tcp/127.0.0.1:7447'
HOUR = 3_600_000_000  # [us]

_COMMON: dict[str, Any] = {
    'scouting/multicast/enabled': False,
    'scouting/gossip/enabled': True,
    'scouting/gossip/target': {'router': ['router', 'peer'], 'peer': ['router']},
    # One of two peers connects, not both: crossing attempts may cost a tenth of a second.
    'scouting/gossip/autoconnect_strategy': {
        'peer': {'to_router': 'always', 'to_peer': 'greater-zid'}
    },
    'timestamping/enabled': True,
    'queries_default_timeout': 600_000,
    'transport/unicast/open_timeout': 60_000,
    'transport/unicast/accept_timeout': 60_000,
    'transport/unicast/accept_pending': 10_000,
    'transport/unicast/max_sessions': 10_000,
    'transport/shared_memory/enabled': False,
    # A process that does not answer so long [ms] is dropped by others, to whom it announces this,
    # unless what they write to it waits.
    'transport/link/tx/lease': 60_000,
    'transport/link/tx/keep_alive': 2,
    # A publisher waits this long for a subscriber before it gives up the link, and with it what
    # was published: longer than any callback takes. That of a process that ends breaks at once.
    'transport/link/tx/queue/congestion_control/block/wait_before_close': HOUR,
}
_SESSION: dict[str, Any] = {
    'mode': 'peer',
    'listen/endpoints': ['tcp/127.0.0.1:0'],
    # Whether the router answers is looked at in session.py, where it does not take half a second.
    'open/return_conditions/connect_scouted': False,
    'connect/retry': {
        'period_init_ms': 100,
        'period_max_ms': 1000,
        'period_increase_factor': 2,
    },
}
_PROBE: dict[str, Any] = {
    'mode': 'client',
    'connect/timeout_ms': 0,
    'scouting/multicast/enabled': False,
}
_ROUTER: dict[str, Any] = {
    'mode': 'router',
    'connect/endpoints': [],
    'scouting/delay': 0,
    # Peers have direct links; a router that also forwards would deliver some samples twice.
    'routing/router/peers_failover_brokering': False,
}


def router_endpoint() -> str:
    """Endpoint of the router."""
    return os.environ.get('MECHANISM_SIM_ROUTER') or LOOPBACK


def router_attempts() -> int | None:
    """Number of attempts to find a router before opening one; None: as the situation demands."""
    text = os.environ.get('ZENOH_ROUTER_CHECK_ATTEMPTS', '')
    return _number('ZENOH_ROUTER_CHECK_ATTEMPTS', text) if text else None


def opens_router() -> bool:
    """True if a process opens a router on this machine where none answers."""
    here = is_loopback(router_endpoint()) and not connects_elsewhere()
    return here and router_attempts() is None


def domain_id() -> int:
    """The ROS domain."""
    text = os.environ.get('ROS_DOMAIN_ID') or '0'
    number = _number('ROS_DOMAIN_ID', text)
    if number < 0:  # whose keys nobody would find
        raise InvalidSettingError(f'ROS_DOMAIN_ID={text!r}: a domain is a number from 0 on')
    return number


def has_type_hashes() -> bool:
    """True if keys carry type hashes: from Iron on."""
    return os.environ.get('ROS_DISTRO') != 'humble'


def connects_elsewhere() -> bool:
    """True if the environment gives the endpoints to connect to."""
    settings = dict(_overrides())
    return bool(os.environ.get('ZENOH_SESSION_CONFIG_URI')) or any(
        key == 'mode' or key.startswith('connect') for key in settings
    )


def session_config() -> zenoh.Config:
    """Configuration of the session of a process."""
    endpoint = {'connect/endpoints': [router_endpoint()]}
    config = _configuration('ZENOH_SESSION_CONFIG_URI', _COMMON | _SESSION | endpoint)
    for key, value in _overrides():
        _insert(config, key, value)
    return config


def router_config() -> zenoh.Config:
    """Configuration of a router in this process."""
    endpoint = {'listen/endpoints': [router_endpoint()]}
    return _configuration('ZENOH_ROUTER_CONFIG_URI', _COMMON | _ROUTER | endpoint)


def probe_config(timeout: float) -> zenoh.Config:
    """Configuration of a session that finds a router within ``timeout`` [s] or fails."""
    config = _configuration('', _PROBE | {'connect/endpoints': [router_endpoint()]})
    config.insert_json5('transport/unicast/open_timeout', str(round(timeout * 1000)))
    return config


def is_loopback(endpoint: str) -> bool:
    """True if an endpoint is on this machine, out of reach of others."""
    host, _ = _host_and_port(endpoint)
    return host in {'localhost', '::1'} or host.startswith('127.')


def answers(endpoint: str) -> bool:
    """True if anybody accepts connections at an endpoint ``tcp/host:port``."""
    try:
        with socket.create_connection(_host_and_port(endpoint), timeout=2.0):
            return True
    except OSError:
        return False


def _host_and_port(endpoint: str) -> tuple[str, int]:
    protocol, _, address = endpoint.partition('/')
    host, _, port = address.partition('#')[0].rpartition(':')
    if protocol != 'tcp' or not host or not port.isdecimal():
        raise InvalidSettingError(
            f'MECHANISM_SIM_ROUTER={endpoint!r} is no endpoint of the form tcp/127.0.0.1:7447'
        )
    return host.strip('[]'), int(port)


def _configuration(variable: str, defaults: dict[str, Any]) -> zenoh.Config:
    path = os.environ.get(variable) if variable else None
    if path:
        try:
            return zenoh.Config.from_file(path)
        except zenoh.ZError as error:
            raise InvalidSettingError(f'{variable}={path!r} is not readable: {error}') from error
    config = zenoh.Config()
    for key, value in defaults.items():
        config.insert_json5(key, json.dumps(value))
    return config


def _overrides() -> list[tuple[str, str]]:
    text = os.environ.get('ZENOH_CONFIG_OVERRIDE', '')
    pairs = [part.partition('=') for part in text.split(';') if part.strip()]
    return [(key.strip(), value.strip()) for key, _, value in pairs]


def _insert(config: zenoh.Config, key: str, value: str) -> None:
    try:
        config.insert_json5(key, value)
    except zenoh.ZError as error:
        raise InvalidSettingError(f'ZENOH_CONFIG_OVERRIDE: {key}={value}: {error}') from error


def _number(variable: str, text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise InvalidSettingError(f'{variable}={text!r} is not a whole number') from None
