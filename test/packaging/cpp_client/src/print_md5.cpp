#include <jaka_msgs/Move.h>
#include <jaka_msgs/RobotMsg.h>

#include <iostream>

int main() {
  jaka_msgs::Move move;
  move.request.pose = {0.0f, 0.1f, 0.2f, 0.3f, 0.4f, 0.5f};
  std::cout << ros::service_traits::md5sum(move) << ' ' << ros::serialization::serializationLength(move.request) << '\n'
            << ros::message_traits::md5sum<jaka_msgs::RobotMsg>() << '\n';
}
