// Holds the speed of a crank by its torque: read, update, write once a period, as ros2_control has
// it, but in simulated time. With the parameter command_period of crank_drive the machine waits for
// each command, so every run is the same; see docs/control.md.
//   ros2 run mechanism_sim_example_cpp torque_loop --ros-args -p speed:=36.65
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "rclcpp/rclcpp.hpp"
#include "sensor_msgs/msg/joint_state.hpp"
#include "std_msgs/msg/float64.hpp"

using sensor_msgs::msg::JointState;
using std_msgs::msg::Float64;

class TorqueLoop : public rclcpp::Node
{
public:
  TorqueLoop()
  : Node("torque_loop"),
    link_(declare_parameter("link", "crank")),
    speed_(declare_parameter("speed", 36.65)),
    proportional_(declare_parameter("kp", 1.0)),
    integral_(declare_parameter("ki", 10.0)),
    limit_(declare_parameter("limit", 20.0)),
    command_(create_publisher<Float64>("command/effort", 10)),
    state_(create_subscription<JointState>(
        "joint_states", rclcpp::QoS(rclcpp::KeepAll()).reliable(),
        [this](const JointState & state) {cycle(state);}))
  {
  }

private:
  void cycle(const JointState & state)
  {
    const rclcpp::Time now = state.header.stamp;
    if (read(state)) {
      write(update(last_ && now > *last_ ? (now - *last_).seconds() : 0.0));
    }
    last_ = now;
  }

  bool read(const JointState & state)
  {
    const auto found = std::find(state.name.begin(), state.name.end(), link_);
    if (found == state.name.end()) {return false;}
    measured_ = state.velocity[static_cast<std::size_t>(found - state.name.begin())];
    return true;
  }

  double update(double period)
  {
    if (period == 0.0) {sum_ = 0.0;}  // the run begins
    const double error = speed_ - measured_, step = integral_ * error * period;
    const double asked = proportional_ * error + sum_ + step;
    const double effort = std::clamp(asked, -limit_, limit_);
    if (effort == asked) {sum_ += step;}  // else the integral would wind up
    return effort;
  }

  void write(double effort)
  {
    Float64 message;
    message.data = effort;
    command_->publish(message);
  }

  std::string link_;
  double speed_, proportional_, integral_, limit_, measured_ = 0.0, sum_ = 0.0;
  std::optional<rclcpp::Time> last_;
  rclcpp::Publisher<Float64>::SharedPtr command_;
  rclcpp::Subscription<JointState>::SharedPtr state_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<TorqueLoop>());
  rclcpp::shutdown();
  return 0;
}
