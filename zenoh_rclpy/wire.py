"""Keys, liveliness tokens, attachments and gids of ``rmw_zenoh_cpp``, as pure functions.

Read from its sources (``liveliness_utils.cpp``, ``attachment_helpers.cpp``), releases humble
0.1.9 to rolling 0.12.0.
"""

import re
import struct
from typing import NamedTuple

import xxhash

from ros_interfaces.names import full_node_name
from zenoh_rclpy.qos import (
    DEFAULT_DEPTH,
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

TOKENS = '@ros2_lv'
NODE, PUBLISHER, SUBSCRIPTION, SERVICE, CLIENT = 'NN', 'MP', 'MS', 'SS', 'SC'
NO_HASH = 'TypeHashNotSupported'  # what Humble writes

_ATTACHMENT = struct.Struct('<qqB16s')
ATTACHED = _ATTACHMENT.size  # bytes of an attachment
_TOKEN = re.compile(
    rf'{TOKENS}/\d+/(?P<session>\w+)/(?P<node_id>\d{{1,18}})/(?P<entity_id>\d{{1,18}})/'
    r'(?P<kind>NN|MP|MS|SS|SC)/[^/]+/(?P<namespace>[\w%]+)/(?P<node>\w+)'
    r'(?:/(?P<name>%[\w%]+)/(?P<type>\w+::\w+::dds_::\w+_)/(?P<hash>\w+)/(?P<qos>[\d:,]*)(?:/.*)?)?',
    re.ASCII,
)
_LONGEST = 2000  # characters of a token
_INFINITE = (9223372036, 854775807)
_SECOND = 1_000_000_000


class Attachment(NamedTuple):
    """Attachment of every sample, request and reply."""

    sequence: int  # from 1, per endpoint
    time: int  # [ns] at the source
    gid: bytes  # of the publisher or client


class Token(NamedTuple):
    """A node or one of its endpoints, as in its liveliness token."""

    session: str
    node_id: int
    entity_id: int
    kind: str
    namespace: str
    node: str
    name: str = ''
    type: str = ''
    hash: str = ''
    qos: QoSProfile = QoSProfile()

    @property
    def node_name(self) -> str:
        """Fully qualified name of the node."""
        return full_node_name(self.namespace, self.node)


def dds_type(name: str) -> str:
    """'pkg::msg::dds_::Name_' of 'pkg/msg/Name'."""
    package, kind, short = name.split('/')
    return f'{package}::{kind}::dds_::{short}_'


def ros_type(name: str) -> str:
    """'pkg/msg/Name' of 'pkg::msg::dds_::Name_'."""
    return name.replace('::dds_::', '::').removesuffix('_').replace('::', '/')


def data_key(domain: int, name: str, type_name: str, type_hash: str) -> str:
    """Key of a topic or service."""
    return f'{domain}/{name.removeprefix("/")}/{dds_type(type_name)}/{type_hash}'


def token_key(domain: int, token: Token) -> str:
    """Liveliness token of a node or endpoint."""
    fields = [TOKENS, str(domain), token.session, str(token.node_id), str(token.entity_id)]
    # The second empty field is the enclave: security, which nobody here uses.
    fields += [token.kind, '%', _mangle(token.namespace), token.node]
    if token.kind != NODE:
        fields += [_mangle(token.name), dds_type(token.type), token.hash, qos_text(token.qos)]
    return '/'.join(fields)


def parse_token(key: str) -> Token | None:
    """Token of a key, None if it is not one."""
    found = _TOKEN.fullmatch(key) if len(key) <= _LONGEST else None
    if found is None or (found['kind'] == NODE) != (found['name'] is None):
        return None
    known = (
        found['session'],
        int(found['node_id']),
        int(found['entity_id']),
        found['kind'],
        _demangle(found['namespace']) or '/',
        found['node'],
    )
    if found['kind'] == NODE:
        return Token(*known)
    try:
        qos = parse_qos(found['qos'])
    except ValueError:
        return None
    return Token(*known, _demangle(found['name']), ros_type(found['type']), found['hash'], qos)


def gid(key: str) -> bytes:
    """16 bytes that name an endpoint: XXH3-128 of its token, least significant byte first."""
    return xxhash.xxh3_128_intdigest(key.encode()).to_bytes(16, 'little')


def pack_attachment(sequence: int, time: int, endpoint: bytes) -> bytes:
    """33 bytes: sequence number, source time in ns, length of the gid, gid."""
    return _ATTACHMENT.pack(sequence, time, 16, endpoint)


def parse_attachment(data: bytes) -> Attachment | None:
    """Attachment, None if the bytes are not one."""
    if len(data) != ATTACHED:
        return None
    sequence, time, length, endpoint = _ATTACHMENT.unpack(data)
    return Attachment(sequence, time, endpoint) if length == 16 else None


def qos_text(qos: QoSProfile) -> str:
    """Profile as its token writes it: what is the default is left out."""
    plain = QoSProfile()
    reliability = '' if qos.reliability == plain.reliability else int(qos.reliability)
    durability = '' if qos.durability == plain.durability else int(qos.durability)
    history = '' if qos.history == plain.history else int(qos.history)
    depth = '' if qos.depth == DEFAULT_DEPTH else qos.depth
    lifespan = ','
    if qos.lifespan is not None:
        seconds, nanoseconds = divmod(qos.lifespan, _SECOND)
        lifespan = f'{seconds},{nanoseconds}'
    return f'{reliability}:{durability}:{history},{depth}:,:{lifespan}:,,'


def parse_qos(text: str) -> QoSProfile:
    """Profile of the last field of a token; missing policies are the defaults."""
    reliability, durability, queue, _, lifespan, *_ = [*text.split(':'), '', '', '', '', '']
    history, depth, *_ = [*queue.split(','), '']
    seconds, nanoseconds, *_ = [*lifespan.split(','), '']
    span = (int(seconds or _INFINITE[0]), int(nanoseconds or (_INFINITE[1] if not seconds else 0)))
    return QoSProfile(
        depth=int(depth or DEFAULT_DEPTH),
        history=HistoryPolicy(int(history or 1)),
        reliability=ReliabilityPolicy(int(reliability or 1)),
        durability=DurabilityPolicy(int(durability or 2)),
        lifespan=None if span == _INFINITE else span[0] * _SECOND + span[1],
    )


def _mangle(name: str) -> str:
    return '%' if name in {'', '/'} else name.replace('/', '%')


def _demangle(name: str) -> str:
    return '' if name == '%' else name.replace('%', '/')
