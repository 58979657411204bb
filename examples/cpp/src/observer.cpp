// Counts impacts and evaluates the motion of a run on a grid of times; prints both as JSON.
//   ros2 run mechanism_sim_example_cpp observer --ros-args -p period:=0.001
#include <cstdint>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "mechanism_sim/motion.hpp"
#include "mechanism_sim/msg/impact.hpp"
#include "mechanism_sim/msg/motion.hpp"
#include "mechanism_sim/msg/progress.hpp"
#include "rclcpp/rclcpp.hpp"
#include "sensor_msgs/msg/joint_state.hpp"

using mechanism_sim::msg::Impact;
using mechanism_sim::msg::Motion;
using mechanism_sim::msg::Progress;
using sensor_msgs::msg::JointState;

class Observer : public rclcpp::Node
{
public:
  Observer()
  : Node("observer"), period_(declare_parameter("period", 1e-3))
  {
    const auto results = rclcpp::QoS(rclcpp::KeepAll()).reliable();
    subscriptions_ = {
      create_subscription<Impact>("impacts", results, [this](const Impact &) {++heard_["impacts"];}),
      create_subscription<JointState>(
        "joint_states", results, [this](const JointState &) {++heard_["joint_states"];}),
      create_subscription<Motion>("motion", results, [this](const Motion & m) {take(m);}),
      create_subscription<Progress>("progress", results, [this](const Progress & p) {note(p);})};
  }

  /// Whether all has come that the integrator announced at its end.
  bool complete() const
  {
    for (const auto & [topic, count] : announced_) {
      if (heard_.at(topic) < count) {return false;}
    }
    return !announced_.empty();
  }

  void print() const
  {
    std::printf("{\"impacts\": %lu, \"joint_states\": %lu", heard_.at("impacts"),
      heard_.at("joint_states"));
    for (const auto & [name, values] : angles_) {
      std::printf(", \"%s\": [", name.c_str());
      for (std::size_t i = 0; i < values.size(); ++i) {
        std::printf("%s%.17g", i ? ", " : "", values[i]);
      }
      std::printf("]");
    }
    std::printf("}\n");
  }

private:
  void take(const Motion & m)
  {
    ++heard_["motion"];
    for (; mechanism_sim::holds(m, next_ * period_); ++next_) {
      for (std::size_t i = 0; i < m.coordinates.size(); ++i) {
        const auto sample = mechanism_sim::evaluate(m, i, next_ * period_);
        angles_[m.coordinates[i]].push_back(sample.position);
        angles_[m.coordinates[i] + " velocity"].push_back(sample.velocity);
      }
    }
  }

  void note(const Progress & p)
  {
    if (!p.finished) {return;}
    for (std::size_t i = 0; i < p.topics.size(); ++i) {
      const auto topic = p.topics[i].substr(p.topics[i].rfind('/') + 1);
      if (p.node == "linkage" && heard_.count(topic)) {announced_[topic] = p.counts[i];}
    }
  }

  double period_;
  std::uint64_t next_ = 0;
  std::map<std::string, std::uint64_t> heard_{{"impacts", 0}, {"joint_states", 0}, {"motion", 0}};
  std::map<std::string, std::uint64_t> announced_;
  std::map<std::string, std::vector<double>> angles_;
  std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  const auto observer = std::make_shared<Observer>();
  while (rclcpp::ok() && !observer->complete()) {
    rclcpp::spin_some(observer);
    rclcpp::sleep_for(std::chrono::milliseconds(1));
  }
  observer->print();
  rclcpp::shutdown();
  return observer->complete() ? 0 : 1;
}
