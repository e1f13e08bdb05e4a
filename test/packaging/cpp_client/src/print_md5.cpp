#include <jaka_msgs/ClearError.h>
#include <jaka_msgs/Move.h>
#include <jaka_msgs/RobotMsg.h>
#include <jaka_msgs/ServoMove.h>

#include <iostream>

int main() {
  jaka_msgs::Move move;
  move.request.pose = {0.0f, 0.1f, 0.2f, 0.3f, 0.4f, 0.5f};
  jaka_msgs::ServoMove servo_move;
  servo_move.request.speed = {1.0f};
  jaka_msgs::ClearError clear_error;
  clear_error.request.enable = true;
  std::cout << ros::serialization::serializationLength(move.request) << '\n'
            << ros::service_traits::md5sum(move) << '\n'
            << ros::message_traits::md5sum<jaka_msgs::RobotMsg>() << '\n'
            << ros::service_traits::md5sum(servo_move) << '\n'
            << ros::service_traits::md5sum(clear_error) << '\n';
}
