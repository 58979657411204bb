"""Names of a node, and its view of the graph."""

from typing import NamedTuple

from ros_interfaces import names
from zenoh_rclpy import wire
from zenoh_rclpy.arguments import Arguments
from zenoh_rclpy.qos import QoSProfile
from zenoh_rclpy.session import Context
from zenoh_rclpy.tasks import Tasks
from zenoh_rclpy.warnings import Warnings


class TopicEndpointInfo(NamedTuple):
    """A publisher or subscription of any node."""

    node_name: str
    node_namespace: str
    topic_type: str
    topic_type_hash: str
    endpoint_gid: list[int]
    qos_profile: QoSProfile


class NodeGraph:
    """Name of a node and its view of the graph; what its endpoints need of it.

    Attributes
    ----------
    context : session and graph of the process
    tasks : runs callbacks that are coroutines
    warnings : logs what Zenoh's threads have to say
    """

    tasks: Tasks
    warnings: Warnings

    def __init__(self, context: Context, name: str, namespace: str, arguments: Arguments) -> None:
        self.context = context
        self._arguments = arguments
        names.check_node_name(name)
        self._name = names.check_node_name(arguments.node_name(name))
        remap = arguments.namespace(self._name)
        self._namespace = names.resolve_namespace(namespace if remap is None else remap)
        self._id = context.next_id()

    def token(self, kind: str, name: str, type_name: str, qos: QoSProfile) -> wire.Token:
        """Token for a new endpoint of this node."""
        described = self._describe(kind, self.context.next_id())
        hashed = self.context.hash_of(type_name)
        return described._replace(name=name, type=type_name, hash=hashed, qos=qos)

    def get_name(self) -> str:
        """Name without the namespace."""
        return self._name

    def get_namespace(self) -> str:
        """Namespace, '/' for the root."""
        return self._namespace

    def get_fully_qualified_name(self) -> str:
        """'/namespace/name'."""
        return names.full_node_name(self._namespace, self._name)

    def get_node_names(self) -> list[str]:
        """Names of all nodes, without namespaces."""
        return [token.node for token in self.context.graph.nodes()]

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """Names and namespaces of all nodes."""
        return [(token.node, token.namespace) for token in self.context.graph.nodes()]

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Topics with publishers or subscriptions."""
        return self.context.graph.names_and_types((wire.PUBLISHER, wire.SUBSCRIPTION))

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Services with servers."""
        return self.context.graph.names_and_types((wire.SERVICE,))

    def get_publisher_names_and_types_by_node(
        self, node_name: str, node_namespace: str
    ) -> list[tuple[str, list[str]]]:
        """Topics on which a node publishes."""
        return self._by_node(wire.PUBLISHER, node_name, node_namespace)

    def get_subscriber_names_and_types_by_node(
        self, node_name: str, node_namespace: str
    ) -> list[tuple[str, list[str]]]:
        """Topics to which a node subscribes."""
        return self._by_node(wire.SUBSCRIPTION, node_name, node_namespace)

    def get_service_names_and_types_by_node(
        self, node_name: str, node_namespace: str
    ) -> list[tuple[str, list[str]]]:
        """Services of a node."""
        return self._by_node(wire.SERVICE, node_name, node_namespace)

    def get_client_names_and_types_by_node(
        self, node_name: str, node_namespace: str
    ) -> list[tuple[str, list[str]]]:
        """Services for which a node has clients."""
        return self._by_node(wire.CLIENT, node_name, node_namespace)

    def count_publishers(self, topic: str) -> int:
        """Number of publishers on a topic."""
        return self.context.graph.count(wire.PUBLISHER, self.resolve_topic_name(topic))

    def count_subscribers(self, topic: str) -> int:
        """Number of subscriptions to a topic."""
        return self.context.graph.count(wire.SUBSCRIPTION, self.resolve_topic_name(topic))

    def get_publishers_info_by_topic(self, topic: str) -> list[TopicEndpointInfo]:
        """Publishers of a topic."""
        return self._infos(wire.PUBLISHER, topic)

    def get_subscriptions_info_by_topic(self, topic: str) -> list[TopicEndpointInfo]:
        """Subscriptions of a topic."""
        return self._infos(wire.SUBSCRIPTION, topic)

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:
        """Fully qualified name of a topic, after the rules of the command line."""
        return self._resolve(topic, 'topic', only_expand)

    def resolve_service_name(self, service: str, *, only_expand: bool = False) -> str:
        """Fully qualified name of a service, after the rules of the command line."""
        return self._resolve(service, 'service', only_expand)

    def _describe(self, kind: str, entity_id: int) -> wire.Token:
        session = self.context.zid
        return wire.Token(session, self._id, entity_id, kind, self._namespace, self._name)

    def _resolve(self, name: str, kind: str, only_expand: bool) -> str:
        full = names.resolve(name, self._namespace, self._name)
        if only_expand:
            return full
        return self._arguments.remap(full, self._namespace, self._name, kind)

    def _by_node(self, kind: str, name: str, namespace: str) -> list[tuple[str, list[str]]]:
        graph = self.context.graph
        return graph.names_and_types((kind,), lambda t: (t.node, t.namespace) == (name, namespace))

    def _infos(self, kind: str, topic: str) -> list[TopicEndpointInfo]:
        found = self.context.graph.find(kind, self.resolve_topic_name(topic))
        return [
            TopicEndpointInfo(
                token.node,
                token.namespace,
                token.type,
                token.hash,
                list(wire.gid(key)),
                token.qos,
            )
            for key, token in found.items()
        ]
