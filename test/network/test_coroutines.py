"""Coroutine callbacks: a service that answers later, and what runs meanwhile."""

import pytest
from middleware_network import PATIENCE, spin_until

from mechanism_sim.messages import Clock, Trigger
from zenoh_rclpy import (
    Future,
    MiddlewareError,
    MutuallyExclusiveCallbackGroup,
    Node,
    ReentrantCallbackGroup,
    spin_once,
)


def test_requests_that_wait_at_once_are_all_answered_while_the_rest_goes_on(network, node):
    server = network.start("""
        from zenoh_rclpy import *
        from mechanism_sim.messages import Clock, Trigger
        init()
        node = Node('server')
        waiting = []
        async def answer(request, response):
            waiting.append(Future())
            response.message = await waiting[-1]
            response.success = True
            return response
        def let_go(message):
            for number, future in enumerate(waiting):
                future.set_result(f'{number} of {len(waiting)}')
        node.create_service(Trigger, 'later', answer, callback_group=ReentrantCallbackGroup())
        node.create_service(Trigger, 'now', lambda _, response: response)
        node.create_subscription(Clock, 'let_go', let_go, 10)
        try:
            spin(node)
        except ExternalShutdownException:
            shutdown()
    """)
    later, now = (node.create_client(Trigger, name) for name in ('later', 'now'))
    publisher = node.create_publisher(Clock, 'let_go', 10)
    spin_until(node, lambda: publisher.get_subscription_count() and now.service_is_ready())
    assert later.wait_for_service(PATIENCE)
    answers = [later.call_async(Trigger.Request()) for _ in range(3)]
    # Requests on other keys overtake none of these three: the link keeps their order.
    between = now.call_async(Trigger.Request())
    spin_until(node, between.done)
    assert not any(answer.done() for answer in answers)
    publisher.publish(Clock())
    spin_until(node, lambda: all(answer.done() for answer in answers))
    assert [a.result().message for a in answers] == ['0 of 3', '1 of 3', '2 of 3']
    assert all(answer.result().success for answer in answers)
    server.interrupt(15)
    server.finish()


def test_in_the_default_group_a_callback_that_waits_holds_up_the_others(node):
    gate, heard, done = Future(), [], []

    async def wait(_):
        heard.append('begin')
        await gate
        heard.append('end')

    alone = MutuallyExclusiveCallbackGroup()
    publishers = [node.create_publisher(Clock, name, 10) for name in ('a', 'b', 'c')]
    node.create_subscription(Clock, 'a', wait, 10)
    node.create_subscription(Clock, 'b', lambda _: heard.append('b'), 10)
    node.create_subscription(Clock, 'c', done.append, 10, callback_group=alone)
    ticks = []
    node.create_timer(0.0, lambda: ticks.append(len(heard)))
    spin_until(node, lambda: ticks)
    for publisher in publishers:
        publisher.publish(Clock())
    publishers[0].publish(Clock())
    spin_until(node, lambda: done)
    for _ in range(3):
        spin_once(node, timeout_sec=0.01)
    assert heard == ['begin']
    ticked = len(ticks)
    gate.set_result(None)
    spin_until(node, lambda: len(heard) == 5 and len(ticks) > ticked)
    assert heard == ['begin', 'end', 'b', 'begin', 'end']
    assert 1 not in ticks


def test_a_coroutine_may_ask_a_service_and_gets_its_errors(node):
    group = ReentrantCallbackGroup()
    client = node.create_client(Trigger, 'inner', callback_group=group)
    nobody = node.create_client(Trigger, 'nobody', callback_group=group)

    async def outer(_, response):
        first = await client.call_async(Trigger.Request())
        second = await client.call_async(Trigger.Request())
        response.message = first.message + second.message
        try:
            await nobody.call_async(Trigger.Request())
        except MiddlewareError as error:
            response.message += f' {error}'
        return response

    def inner(_, response):
        response.message = 'x'
        return response

    node.create_service(Trigger, 'outer', outer, callback_group=group)
    node.create_service(Trigger, 'inner', inner)
    answer = node.create_client(Trigger, 'outer').call_async(Trigger.Request())
    spin_until(node, answer.done)
    assert answer.result().message == 'xx /nobody did not answer'


def test_what_a_coroutine_raises_comes_out_of_the_executor(node):
    gate = Future()

    async def fail():
        timer.cancel()
        await gate
        raise ValueError('a mistake of the node')

    timer = node.create_timer(0.0, fail, ReentrantCallbackGroup())
    spin_until(node, timer.is_canceled)
    gate.set_result(None)
    with pytest.raises(ValueError, match='a mistake of the node'):
        spin_until(node, lambda: False)


def test_who_asked_a_node_that_goes_away_is_told(node):
    server = Node('fleeting')

    async def never(request, _):
        asked.append(request)
        await Future()

    asked = []
    server.create_service(Trigger, 'never', never)
    answer = node.create_client(Trigger, 'never').call_async(Trigger.Request())
    spin_until(server, lambda: asked)
    server.destroy_node()
    spin_until(node, answer.done)
    with pytest.raises(MiddlewareError, match='/never did not answer'):
        answer.result()


def test_futures():
    future, told = Future(), []
    future.add_done_callback(lambda f: told.append(f.cancelled()))
    future.cancel()
    assert (future.cancelled(), future.done(), told) == (True, False, [True])
    future.set_result(3)
    assert (future.cancelled(), future.done(), future.result()) == (False, True, 3)
    future.cancel()
    assert not future.cancelled()
