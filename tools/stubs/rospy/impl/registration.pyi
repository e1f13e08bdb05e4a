from rospy.service import ServiceManager
from rospy.topics import _TopicManager

class Registration:
    PUB: str
    SUB: str
    SRV: str

class RegistrationListeners:
    def notify_added(self, resolved_name: str, data_type: str, reg_type: str) -> None: ...

def get_registration_listeners() -> RegistrationListeners: ...
def get_service_manager() -> ServiceManager: ...
def get_topic_manager() -> _TopicManager: ...
