// Counts the messages of a driver's three state topics for some seconds, and prints what the last of each has.
#include <geometry_msgs/TwistStamped.h>
#include <jaka_msgs/RobotMsg.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>

#include <cstdlib>
#include <iostream>

template <class Message>
struct Heard {
  int count = 0;
  int gaps = 0;
  Message last;
};

bool follows(const std_msgs::Header& before, const std_msgs::Header& next) {
  return next.seq == before.seq + 1 && next.stamp > before.stamp;
}
bool follows(const geometry_msgs::TwistStamped& a, const geometry_msgs::TwistStamped& b) {
  return follows(a.header, b.header);
}
bool follows(const sensor_msgs::JointState& a, const sensor_msgs::JointState& b) { return follows(a.header, b.header); }
bool follows(const jaka_msgs::RobotMsg&, const jaka_msgs::RobotMsg&) { return true; }

template <class Message>
ros::Subscriber listen(ros::NodeHandle& node, const std::string& topic, Heard<Message>& heard) {
  return node.subscribe<Message>(topic, 1000, [&heard](const boost::shared_ptr<const Message>& message) {
    if (heard.count > 0 && !follows(heard.last, *message)) ++heard.gaps;
    heard.last = *message;
    ++heard.count;
  }, ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
}

void print(const geometry_msgs::Vector3& v) { std::cout << ' ' << v.x << ' ' << v.y << ' ' << v.z; }

int main(int argc, char** argv) {
  ros::init(argc, argv, "count_states", ros::init_options::AnonymousName | ros::init_options::NoRosout);
  if (argc != 3) {
    std::cerr << "usage: count_states NODE SECONDS\n";
    return 2;
  }
  ros::NodeHandle node;
  const std::string name = argv[1];
  Heard<geometry_msgs::TwistStamped> tool;
  Heard<sensor_msgs::JointState> joints;
  Heard<jaka_msgs::RobotMsg> states;
  const auto first = listen(node, name + "/tool_position", tool);
  const auto second = listen(node, name + "/joint_position", joints);
  const auto third = listen(node, name + "/robot_states", states);
  while (ros::ok() && !(tool.count && joints.count && states.count)) {
    ros::spinOnce();
    ros::WallDuration(0.001).sleep();
  }
  tool.count = joints.count = states.count = 0;
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(std::atof(argv[2]));
  while (ros::ok() && ros::WallTime::now() < end) {
    ros::spinOnce();
    ros::WallDuration(0.001).sleep();
  }
  std::cout.precision(17);
  std::cout << "tool_position " << tool.count << ' ' << tool.gaps << ' ' << tool.last.header.frame_id;
  print(tool.last.twist.linear);
  print(tool.last.twist.angular);
  std::cout << "\njoint_position " << joints.count << ' ' << joints.gaps;
  for (const std::string& joint : joints.last.name) std::cout << ' ' << joint;
  for (const double position : joints.last.position) std::cout << ' ' << position;
  std::cout << "\nrobot_states " << states.count << ' ' << states.last.motion_state << ' ' << states.last.power_state
            << ' ' << states.last.servo_state << ' ' << states.last.collision_state << '\n';
}
