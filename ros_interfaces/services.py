"""Definitions of the services that nodes of ROS 2 Jazzy serve and rosbags does not bring."""

SERVICES = {
    'action_msgs/srv/CancelGoal': """GoalInfo goal_info
---
int8 ERROR_NONE=0
int8 ERROR_REJECTED=1
int8 ERROR_UNKNOWN_GOAL_ID=2
int8 ERROR_GOAL_TERMINATED=3
int8 return_code
GoalInfo[] goals_canceling
""",
    'std_srvs/srv/Trigger': """---
bool success
string message
""",
    'rcl_interfaces/srv/DescribeParameters': """string[] names
---
ParameterDescriptor[] descriptors
""",
    'rcl_interfaces/srv/GetParameterTypes': """string[] names
---
uint8[] types
""",
    'rcl_interfaces/srv/GetParameters': """string[] names
---
ParameterValue[] values
""",
    'rcl_interfaces/srv/ListParameters': """uint64 DEPTH_RECURSIVE=0
string[] prefixes
uint64 depth
---
ListParametersResult result
""",
    'rcl_interfaces/srv/SetParameters': """Parameter[] parameters
---
SetParametersResult[] results
""",
    'rcl_interfaces/srv/SetParametersAtomically': """Parameter[] parameters
---
SetParametersResult result
""",
    'lifecycle_msgs/srv/ChangeState': """Transition transition
---
bool success
""",
    'lifecycle_msgs/srv/GetAvailableStates': """---
State[] available_states
""",
    'lifecycle_msgs/srv/GetAvailableTransitions': """---
TransitionDescription[] available_transitions
""",
    'lifecycle_msgs/srv/GetState': """---
State current_state
""",
}
