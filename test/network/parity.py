"""Use of the middleware by nodes, for any back end: prints the results as JSON.

Run by test_parity.py in a process of its own for each back end.
"""

import json
import sys
import time
from importlib.machinery import ModuleSpec
from types import ModuleType

if sys.argv[1] == 'rclpy':
    # The back end of ROS, also where this package's own messages have not been built for it.
    own = ModuleType('mechanism_sim.msg')
    own.__spec__ = ModuleSpec('mechanism_sim.msg', None)
    sys.modules.setdefault('mechanism_sim.msg', own)

from mechanism_sim.messages import (
    Clock,
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    ParameterEvent,
    SetParametersResult,
    String,
    Trigger,
)
from mechanism_sim.nodes import middleware as mw

PATIENCE = 300.0


def spin_until(node, condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError
        mw.spin_once(node, timeout_sec=0.05)


def linger(node, seconds=0.2):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        mw.spin_once(node, timeout_sec=0.02)


def name_of_error(call, *arguments, **keywords):
    try:
        call(*arguments, **keywords)
    except Exception as error:
        return type(error).__name__
    return None


def services_answer_later():
    node = mw.Node('later')
    group, waiting = mw.ReentrantCallbackGroup(), []

    async def later(_, response):
        waiting.append(mw.Future())
        response.message = await waiting[-1]
        return response

    def now(_, response):
        response.message = 'now'
        return response

    node.create_service(Trigger, 'later', later, callback_group=group)
    node.create_service(Trigger, 'now', now)
    slow = node.create_client(Trigger, 'later', callback_group=group)
    quick = node.create_client(Trigger, 'now')
    spin_until(node, lambda: slow.service_is_ready() and quick.service_is_ready())
    answers = [slow.call_async(Trigger.Request()) for _ in range(2)]
    spin_until(node, lambda: len(waiting) == 2)
    between = quick.call_async(Trigger.Request())
    spin_until(node, between.done)
    said = [between.result().message, any(answer.done() for answer in answers)]
    for number, future in enumerate(waiting):
        future.set_result(f'answer {number}')
    spin_until(node, lambda: all(answer.done() for answer in answers))
    node.destroy_node()
    return said + [answer.result().message for answer in answers]


def a_callback_that_waits_holds_up_its_group():
    node = mw.Node('holding')
    gate, heard, done = mw.Future(), [], []

    async def wait(_):
        heard.append('begin')
        await gate
        heard.append('end')

    alone = mw.MutuallyExclusiveCallbackGroup()
    publishers = {name: node.create_publisher(String, name, 10) for name in 'abc'}
    node.create_subscription(String, 'a', wait, 10)
    node.create_subscription(String, 'b', lambda _: heard.append('b'), 10)
    node.create_subscription(String, 'c', done.append, 10, callback_group=alone)
    spin_until(node, lambda: all(p.get_subscription_count() for p in publishers.values()))
    publishers['a'].publish(String())
    spin_until(node, lambda: heard)
    publishers['b'].publish(String())
    publishers['c'].publish(String())
    spin_until(node, lambda: done)
    linger(node)
    held = list(heard)
    gate.set_result(None)
    spin_until(node, lambda: len(heard) == 3)
    node.destroy_node()
    return [held, heard]


def actions_run_side_by_side():
    from mechanism_sim.messages import SimulateSteps  # noqa: PLC0415

    node = mw.Node('acting')
    gates, states = {}, []

    async def execute(handle):
        steps = handle.request.steps
        gate = gates[steps] = mw.Future()
        handle.publish_feedback(SimulateSteps.Feedback(completed_steps=steps))
        await gate
        result = SimulateSteps.Result()
        result.result.error_message = str(steps)
        states.append([steps, handle.is_cancel_requested, handle.is_active])
        if steps == 4:
            raise ValueError('a mistake')
        if handle.is_cancel_requested:
            handle.canceled()
        elif steps != 3:
            handle.succeed()
        return result

    mw.ActionServer(
        node,
        SimulateSteps,
        'steps',
        execute,
        goal_callback=lambda goal: mw.GoalResponse(2 - (goal.steps == 9)),
        cancel_callback=lambda _: mw.CancelResponse.ACCEPT,
    )
    client = mw.ActionClient(node, SimulateSteps, 'steps')
    spin_until(node, client.server_is_ready)

    def get(future):
        spin_until(node, future.done)
        return future.result()

    feedback = []
    handles = {
        n: get(
            client.send_goal_async(
                SimulateSteps.Goal(steps=n),
                lambda message: feedback.append(message.feedback.completed_steps),
            )
        )
        for n in (1, 2, 3, 4, 9)
    }
    spin_until(node, lambda: len(gates) == 4 and len(feedback) == 4)
    results = [handles[n].get_result_async() for n in (1, 2, 3, 4)]
    cancelled = get(handles[2].cancel_goal_async())
    same = bytes(cancelled.goals_canceling[0].goal_id.uuid) == bytes(handles[2].goal_id.uuid)
    for gate in gates.values():
        gate.set_result(None)
    answers = [get(result) for result in results]
    spin_until(node, lambda: handles[1].status == 4)
    terminated = get(handles[1].cancel_goal_async())
    wrong = name_of_error(client.send_goal_async, SimulateSteps.Result())
    node.destroy_node()
    return {
        'accepted': [handles[n].accepted for n in handles],
        'feedback': sorted(feedback),
        'cancelled': [cancelled.return_code, len(cancelled.goals_canceling), same],
        'states': sorted(states),
        'results': [[answer.status, answer.result.result.error_message] for answer in answers],
        'terminated': [terminated.return_code, len(terminated.goals_canceling)],
        'wrong goal': wrong,
    }


def quality_of_service_is_overridden():
    start = 'qos_overrides./drive.publisher.'
    values = {
        f'{start}depth': 7, f'{start}history': 'keep_last',
        'qos_overrides./b.publisher.reliability': 'maybe', 'qos_overrides./c.publisher.depth': 'x',
    }  # fmt: skip
    line = [word for key, value in values.items() for word in ('-p', f'{key}:={value}')]
    node = mw.Node('qos', cli_args=['--ros-args', *line])
    options = mw.QoSOverridingOptions.with_default_policies()

    def make(topic):
        qos = mw.QoSProfile(depth=1000, history=mw.HistoryPolicy.KEEP_ALL)
        return node.create_publisher(String, topic, qos, qos_overriding_options=options)

    profile = make('drive').qos_profile
    found = [
        profile.depth, profile.history.name, profile.reliability.name,
        node.get_parameter(f'{start}reliability').value,
        node.set_parameters([mw.Parameter(f'{start}depth', value=3)])[0].successful,
        node.describe_parameter(f'{start}depth').description,
    ]  # fmt: skip
    try:
        make('b')
    except RuntimeError:
        found.append('RuntimeError')
    found.append(name_of_error(make, 'c'))
    node.destroy_node()
    return found


def command_lines_are_heeded():
    lines = [
        '-r __node:=x -r __ns:=/n -r a:=c', '-r named:b:=/d -r other:a:=e', '-r ~/a:=f -r b:=~/g',
        '-p named:gain:=2 -p gain:=1e-3 -p text:=1:30 -p list:=[0x10,010]',
    ]  # fmt: skip
    found = []
    for line in lines:
        node = mw.Node('named', cli_args=['--ros-args', *line.split()])
        for name in ('gain', 'text', 'list'):
            node.declare_parameter(name, None, ParameterDescriptor(dynamic_typing=True))
        values = [node.get_parameter(name).value for name in ('gain', 'text', 'list')]
        names = [node.resolve_topic_name('a'), node.resolve_topic_name('~/a')]
        names.append(node.resolve_service_name('b'))
        found.append([node.get_fully_qualified_name(), *names, *(
            value if isinstance(value, float | str | None) else list(value) for value in values
        )])  # fmt: skip
        node.destroy_node()
    left = mw.remove_ros_args(['a', '--ros-args', '-p', 'x:=1', '--', 'b'])
    return [*found, left, mw.remove_ros_args(['c'])]


def parameters_are_declared_and_set():
    node = mw.Node('owner', parameter_overrides=[mw.Parameter('a.size', value=3)])
    told, events = [], []
    node.create_subscription(
        ParameterEvent, '/parameter_events',
        lambda e: events.extend([[p.name for p in names] for names in (
            e.new_parameters, e.changed_parameters, e.deleted_parameters
        )] for _ in range(e.node == '/owner')), 100,
    )  # fmt: skip
    spin_until(node, lambda: node.count_subscribers('/parameter_events'))
    linger(node)
    events.clear()
    node.add_post_set_parameters_callback(lambda changed: told.append([p.name for p in changed]))
    kind = mw.Parameter.Type.STRING
    declared = node.declare_parameters('a', [('size', 1), ('kind', kind)])
    real = ParameterDescriptor(
        floating_point_range=[FloatingPointRange(from_value=10.0, to_value=0.0, step=0.1)]
    )
    whole = ParameterDescriptor(integer_range=[IntegerRange(from_value=1, to_value=10, step=4)])
    node.declare_parameter('real', 0.3, real)
    node.declare_parameter('whole', 5, whole)
    node.declare_parameter('any', 1, ParameterDescriptor(dynamic_typing=True))
    node.declare_parameter('fixed', 1, ParameterDescriptor(read_only=True))

    def agree(parameters):
        return SetParametersResult(successful=all(p.value != 9.0 for p in parameters), reason='no')

    node.add_on_set_parameters_callback(agree)

    def tried(name, *values):
        return [
            node.set_parameters([mw.Parameter(name, value=value)])[0].successful
            for value in values
        ]

    both = [mw.Parameter('a.kind', value='s'), mw.Parameter('real', value=11.0)]
    found = {
        'declared': [p.value for p in declared],
        'unset': name_of_error(node.get_parameter, 'a.kind'),
        'or': node.get_parameter_or('a.kind', mw.Parameter('x', value=7)).value,
        'real': tried('real', 0.7, 0.75, 0.0, 10.0, 10.1, -0.1, 9.0, 1),
        'whole': tried('whole', 1, 2, 9, 10, 11),
        'any': tried('any', 'text', None),
        'fixed': tried('fixed', 2),
        'both': node.set_parameters_atomically(both).successful,
        'first of both': node.set_parameters_atomically(both[:1]).successful,
        'no value': tried('a.kind', None),
        'names': list(node.list_parameters(['a'], 0).names),
        'prefixes': list(node.list_parameters(['a'], 0).prefixes),
        'has': [node.has_parameter(name) for name in ('any', 'fixed')],
        'errors': [
            name_of_error(node.get_parameter, 'none'),
            name_of_error(node.set_parameters, [mw.Parameter('none', value=1)]),
            name_of_error(node.declare_parameter, 'real', 1.0),
            name_of_error(node.declare_parameter, 'r', 11.0, real),
            name_of_error(node.declare_parameter, 's', None, ParameterDescriptor()),
            name_of_error(node.declare_parameter, '', 1),
            name_of_error(node.undeclare_parameter, 'fixed'),
            name_of_error(node.undeclare_parameter, 'none'),
        ],
    }
    wrong = mw.Node('wrong', parameter_overrides=[mw.Parameter('x', value=1)])
    found['errors'].append(name_of_error(wrong.declare_parameter, 'x', 1.0))
    wrong.destroy_node()
    found['told'] = told[:6]
    spin_until(node, lambda: events.count([['a.kind'], [], []]) == 2)
    found['events'] = events[:2] + events[-2:]
    node.destroy_node()
    return found


def timers_follow_simulated_time():
    node = mw.Node('timed', parameter_overrides=[mw.Parameter('use_sim_time', value=True)])
    publisher = node.create_publisher(Clock, '/clock', 10)
    calls, wall = [], []
    node.create_timer(0.5, lambda: calls.append(node.get_clock().now().nanoseconds / 1e9))
    node.create_timer(0.05, lambda: wall.append(1), clock=mw.Clock())
    spin_until(node, publisher.get_subscription_count)
    for tick in (10.0, 10.2, 10.5, 0.0, 0.4, 0.6, 5.7, 5.9, 6.0):
        time_now = mw.Time(seconds=tick)
        publisher.publish(Clock(clock=time_now.to_msg()))
        spin_until(node, lambda: node.get_clock().now().nanoseconds == time_now.nanoseconds)  # noqa: B023
        linger(node, 0.05)
    spin_until(node, lambda: wall)
    active = node.get_clock().ros_time_is_active
    node.destroy_node()
    return [calls, active]


if __name__ == '__main__':
    mw.init(args=[])
    scenarios = [
        services_answer_later, a_callback_that_waits_holds_up_its_group, actions_run_side_by_side,
        quality_of_service_is_overridden, command_lines_are_heeded,
        parameters_are_declared_and_set, timers_follow_simulated_time,
    ]  # fmt: skip
    outcome = {'backend': mw.backend()}
    for scenario in scenarios:
        try:
            outcome[scenario.__name__] = scenario()
        except Exception as error:
            outcome[scenario.__name__] = f'{type(error).__name__}: {error}'
            if '--raise' in sys.argv:
                raise
    mw.shutdown()
    print('OUTCOME', json.dumps(outcome))
