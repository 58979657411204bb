"""Actions, across processes and inside one."""

import pytest
from middleware_network import PATIENCE, spin_until

from mechanism_sim.messages import CancelGoal, GoalStatus, SimulateSteps, message_class
from zenoh_rclpy import (
    ActionClient,
    ActionServer,
    CancelResponse,
    Future,
    MiddlewareError,
)

Goal, Result, Feedback = SimulateSteps.Goal, SimulateSteps.Result, SimulateSteps.Feedback


def get(node, future):
    spin_until(node, future.done)
    return future.result()


def result_of(code=1, text=''):
    result = Result()
    result.result.result, result.result.error_message = code, text
    return result


def test_goals_go_to_another_process_and_come_back_with_feedback(network, node):
    server = network.start("""
        from zenoh_rclpy import *
        from mechanism_sim.messages import SimulateSteps
        init()
        node = Node('server', namespace='machine')
        def execute(handle):
            steps = handle.request.steps
            for done in range(1, steps + 1):
                handle.publish_feedback(
                    SimulateSteps.Feedback(completed_steps=done, remaining_steps=steps - done)
                )
            handle.succeed()
            result = SimulateSteps.Result()
            result.result.error_message = f'{steps} steps'
            return result
        ActionServer(
            node, SimulateSteps, 'simulate_steps', execute,
            goal_callback=lambda goal: GoalResponse(1 + bool(goal.steps)),
        )
        try:
            spin(node)
        except ExternalShutdownException:
            shutdown()
    """)
    client = ActionClient(node, SimulateSteps, '/machine/simulate_steps')
    assert client.wait_for_server(PATIENCE)
    heard = []
    handle = get(node, client.send_goal_async(Goal(steps=5), heard.append))
    assert handle.accepted
    assert handle.stamp.sec > 0
    answer = get(node, handle.get_result_async())
    assert (answer.status, answer.result.result.error_message) == (4, '5 steps')
    assert [(m.feedback.completed_steps, m.feedback.remaining_steps) for m in heard] == [
        (1, 4), (2, 3), (3, 2), (4, 1), (5, 0),
    ]  # fmt: skip
    assert all(bytes(m.goal_id.uuid) == bytes(handle.goal_id.uuid) for m in heard)
    spin_until(node, lambda: handle.status == GoalStatus.STATUS_SUCCEEDED)
    assert not get(node, client.send_goal_async(Goal(steps=0))).accepted
    services = dict(node.get_service_names_and_types())
    assert services['/machine/simulate_steps/_action/send_goal'] == [
        'simulation_interfaces/action/SimulateSteps_SendGoal'
    ]
    assert services['/machine/simulate_steps/_action/cancel_goal'] == [
        'action_msgs/srv/CancelGoal'
    ]
    (status,) = node.get_publishers_info_by_topic('/machine/simulate_steps/_action/status')
    assert (status.qos_profile.depth, status.qos_profile.durability.name) == (1, 'TRANSIENT_LOCAL')
    server.interrupt(15)
    server.finish()
    assert not client.wait_for_server(timeout_sec=0.05)


def test_goals_are_executed_side_by_side_and_cancelled_one_by_one(node):
    gates = {}

    async def execute(handle):
        gate = gates[handle.request.steps] = Future()
        await gate
        if handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.succeed()
        return result_of(text=str(handle.request.steps))

    server = ActionServer(
        node, SimulateSteps, 'steps', execute,
        cancel_callback=lambda handle: CancelResponse(1 + (handle.request.steps > 1)),
    )  # fmt: skip
    client = ActionClient(node, SimulateSteps, 'steps')
    handles = [get(node, client.send_goal_async(Goal(steps=n))) for n in (1, 2, 3)]
    results = [handle.get_result_async() for handle in handles]
    spin_until(node, lambda: len(gates) == 3)
    refused, agreed = (get(node, handle.cancel_goal_async()) for handle in handles[:2])
    assert (refused.return_code, refused.goals_canceling) == (refused.ERROR_REJECTED, [])
    assert (agreed.return_code, len(agreed.goals_canceling)) == (0, 1)
    assert bytes(agreed.goals_canceling[0].goal_id.uuid) == bytes(handles[1].goal_id.uuid)
    spin_until(node, lambda: handles[1].status == GoalStatus.STATUS_CANCELING)
    assert not any(result.done() for result in results)
    for number in (3, 2, 1):
        gates[number].set_result(None)
    answers = [get(node, result) for result in results]
    assert [(a.status, a.result.result.error_message) for a in answers] == [
        (4, '1'), (5, '2'), (4, '3'),
    ]  # fmt: skip
    assert get(node, handles[0].cancel_goal_async()).return_code == 3  # terminated
    assert get(node, handles[2].get_result_async()).status == 4  # a result is kept
    server.destroy()
    client.destroy()


@pytest.mark.parametrize(
    ('end', 'said'),
    [('node.allow(0.0)', '/steps has not answered in 0 s'), ('stop()', 'KeyboardInterrupt()')],
)
def test_a_goal_of_a_command_that_ends_is_cancelled(end, said, network, node):
    """As ``ros2 action send_goal`` does it: after its time, and at a signal."""
    gates = []

    async def execute(handle):
        handle.publish_feedback(Feedback())
        gates.append(Future())
        await gates[-1]
        handle.canceled()
        return result_of()

    def cancel(_):
        gates[-1].set_result(None)
        return CancelResponse.ACCEPT

    server = ActionServer(node, SimulateSteps, 'steps', execute, cancel_callback=cancel)
    command = network.start(f"""
        import os, signal
        from zenoh_rclpy.command_node import command_node
        def stop():
            os.kill(os.getpid(), signal.SIGINT)
        with command_node({PATIENCE}) as node:
            node.bounded = True
            try:
                node.send_goal(
                    '/steps', 'simulation_interfaces/action/SimulateSteps', None, lambda _: {end}
                )
            except BaseException as error:
                print('ended by', repr(error), flush=True)
    """)
    spin_until(node, lambda: gates and gates[-1].done())
    assert said in command.expect('ended by')
    command.finish()
    server.destroy()


def test_requests_to_cancel_by_time_and_all(node):
    async def execute(_):
        await Future()

    ActionServer(
        node, SimulateSteps, 'steps', execute, cancel_callback=lambda _: CancelResponse.ACCEPT
    )
    client = ActionClient(node, SimulateSteps, 'steps')
    cancel = node.create_client(CancelGoal, 'steps/_action/cancel_goal')
    first, second = (get(node, client.send_goal_async(Goal(steps=n))) for n in (1, 2))
    request = CancelGoal.Request()
    request.goal_info.goal_id.uuid = [7] * 16
    assert get(node, cancel.call_async(request)).return_code == 2  # unknown
    request.goal_info.stamp = first.stamp
    answer = get(node, cancel.call_async(request))
    assert [bytes(info.goal_id.uuid) for info in answer.goals_canceling] == [
        bytes(first.goal_id.uuid)
    ]
    answer = get(node, cancel.call_async(CancelGoal.Request()))
    assert [bytes(info.goal_id.uuid) for info in answer.goals_canceling] == [
        bytes(second.goal_id.uuid)
    ]
    answer = get(node, cancel.call_async(CancelGoal.Request()))
    assert (answer.return_code, answer.goals_canceling) == (0, [])


def test_a_goal_whose_callback_fails_or_forgets_is_aborted(node, capfd):
    def execute(handle):
        if handle.request.steps == 1:
            raise ValueError('a mistake')
        if handle.request.steps == 2:
            return result_of(text='forgot')
        handle.succeed()
        with pytest.raises(MiddlewareError, match='SUCCEEDED cannot become ABORTED'):
            handle.abort()
        with pytest.raises(TypeError, match='no feedback'):
            handle.publish_feedback(Goal())
        return result_of(text='well')

    ActionServer(node, SimulateSteps, 'steps', execute)
    client = ActionClient(node, SimulateSteps, 'steps')
    answers = []
    for steps in (1, 2, 3):
        handle = get(node, client.send_goal_async(Goal(steps=steps)))
        answer = get(node, handle.get_result_async())
        answers.append((answer.status, answer.result.result.error_message))
    assert answers == [(6, ''), (6, 'forgot'), (4, 'well')]
    log = capfd.readouterr().err
    assert 'Error raised in execute callback: a mistake' in log
    assert 'left the goal EXECUTING' in log
    with pytest.raises(TypeError, match='no goal of this action'):
        client.send_goal_async(Result())


def test_a_server_may_begin_later_and_forgets_what_is_old(node):
    accepted = []
    server = ActionServer(
        node, SimulateSteps, 'steps', lambda handle: handle.succeed() or result_of(),
        handle_accepted_callback=accepted.append, result_timeout=0,
    )  # fmt: skip
    client = ActionClient(node, SimulateSteps, 'steps')
    uuid = message_class('unique_identifier_msgs/msg/UUID')(uuid=[3] * 16)
    handle = get(node, client.send_goal_async(Goal(), goal_uuid=uuid))
    assert bytes(handle.goal_id.uuid) == bytes([3] * 16)
    assert not get(node, client.send_goal_async(Goal(), goal_uuid=uuid)).accepted
    result = handle.get_result_async()
    spin_until(node, lambda: accepted)
    accepted[0].execute()
    assert get(node, result).status == 4
    assert get(node, client.send_goal_async(Goal())).accepted
    assert get(node, handle.get_result_async()).status == GoalStatus.STATUS_UNKNOWN
    server.destroy()
    lost = client.send_goal_async(Goal())
    with pytest.raises(MiddlewareError, match='send_goal did not answer'):
        get(node, lost)
