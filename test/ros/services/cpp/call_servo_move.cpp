// Calls a servo service as one definition of jaka_msgs/ServoMove has it: once for itself, then over a link that stays.
#include <jaka_msgs/ServoMove.h>
#include <ros/ros.h>

#include <cstdlib>
#include <iostream>

int main(int argc, char** argv) {
  ros::init(argc, argv, "call_servo_move", ros::init_options::AnonymousName | ros::init_options::NoRosout);
  if (argc < 3) {
    std::cerr << "usage: call_servo_move SERVICE VALUE..\n";
    return 2;
  }
  ros::NodeHandle node;
  jaka_msgs::ServoMove servo_move;
  for (int i = 2; i < argc; ++i) servo_move.request.pose.push_back(std::strtof(argv[i], nullptr));
#ifdef WITH_SPEED
  servo_move.request.speed.push_back(0.5f);
#endif
  for (const bool persistent : {false, true}) {
    ros::ServiceClient client = node.serviceClient<jaka_msgs::ServoMove>(argv[1], persistent);
    for (int i = 0; i < 2; ++i) {
      if (!client.call(servo_move)) return 1;
      std::cout << servo_move.response.ret << ' ' << servo_move.response.message << '\n';
    }
  }
}
