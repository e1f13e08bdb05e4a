# Made by test/support/pages/message_stubs.py.
from typing import ClassVar, Sequence

import genpy

class ClearErr:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[ClearErrRequest]]
    _response_class: ClassVar[type[ClearErrResponse]]

class ClearErrRequest(genpy.Message): ...

class ClearErrResponse(genpy.Message):
    ret: int
    message: str
    def __init__(
        self,
        ret: int = ...,
        message: str = ...,
    ) -> None: ...

class ClearError:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[ClearErrorRequest]]
    _response_class: ClassVar[type[ClearErrorResponse]]

class ClearErrorRequest(genpy.Message):
    enable: bool
    def __init__(
        self,
        enable: bool = ...,
    ) -> None: ...

class ClearErrorResponse(genpy.Message):
    ret: int
    message: str
    def __init__(
        self,
        ret: int = ...,
        message: str = ...,
    ) -> None: ...

class GetFK:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[GetFKRequest]]
    _response_class: ClassVar[type[GetFKResponse]]

class GetFKRequest(genpy.Message):
    joint: Sequence[float]
    def __init__(
        self,
        joint: Sequence[float] = ...,
    ) -> None: ...

class GetFKResponse(genpy.Message):
    cartesian_pose: Sequence[float]
    message: str
    def __init__(
        self,
        cartesian_pose: Sequence[float] = ...,
        message: str = ...,
    ) -> None: ...

class GetIK:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[GetIKRequest]]
    _response_class: ClassVar[type[GetIKResponse]]

class GetIKRequest(genpy.Message):
    ref_joint: Sequence[float]
    cartesian_pose: Sequence[float]
    def __init__(
        self,
        ref_joint: Sequence[float] = ...,
        cartesian_pose: Sequence[float] = ...,
    ) -> None: ...

class GetIKResponse(genpy.Message):
    joint: Sequence[float]
    message: str
    def __init__(
        self,
        joint: Sequence[float] = ...,
        message: str = ...,
    ) -> None: ...

class GetIO:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[GetIORequest]]
    _response_class: ClassVar[type[GetIOResponse]]

class GetIORequest(genpy.Message):
    signal: str
    path: int
    type: int
    index: int
    def __init__(
        self,
        signal: str = ...,
        path: int = ...,
        type: int = ...,
        index: int = ...,
    ) -> None: ...

class GetIOResponse(genpy.Message):
    value: float
    message: str
    def __init__(
        self,
        value: float = ...,
        message: str = ...,
    ) -> None: ...

class LoadProgram:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[LoadProgramRequest]]
    _response_class: ClassVar[type[LoadProgramResponse]]

class LoadProgramRequest(genpy.Message):
    name: str
    def __init__(
        self,
        name: str = ...,
    ) -> None: ...

class LoadProgramResponse(genpy.Message):
    success: bool
    message: str
    def __init__(
        self,
        success: bool = ...,
        message: str = ...,
    ) -> None: ...

class Move:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[MoveRequest]]
    _response_class: ClassVar[type[MoveResponse]]

class MoveRequest(genpy.Message):
    pose: Sequence[float]
    has_ref: bool
    ref_joint: Sequence[float]
    mvvelo: float
    mvacc: float
    mvtime: float
    mvradii: float
    coord_mode: int
    index: int
    def __init__(
        self,
        pose: Sequence[float] = ...,
        has_ref: bool = ...,
        ref_joint: Sequence[float] = ...,
        mvvelo: float = ...,
        mvacc: float = ...,
        mvtime: float = ...,
        mvradii: float = ...,
        coord_mode: int = ...,
        index: int = ...,
    ) -> None: ...

class MoveResponse(genpy.Message):
    ret: int
    message: str
    def __init__(
        self,
        ret: int = ...,
        message: str = ...,
    ) -> None: ...

class ServoMove:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[ServoMoveRequest]]
    _response_class: ClassVar[type[ServoMoveResponse]]

class ServoMoveEnable:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[ServoMoveEnableRequest]]
    _response_class: ClassVar[type[ServoMoveEnableResponse]]

class ServoMoveEnableRequest(genpy.Message):
    enable: bool
    def __init__(
        self,
        enable: bool = ...,
    ) -> None: ...

class ServoMoveEnableResponse(genpy.Message):
    ret: int
    message: str
    def __init__(
        self,
        ret: int = ...,
        message: str = ...,
    ) -> None: ...

class ServoMoveRequest(genpy.Message):
    pose: Sequence[float]
    speed: Sequence[float]
    def __init__(
        self,
        pose: Sequence[float] = ...,
        speed: Sequence[float] = ...,
    ) -> None: ...

class ServoMoveResponse(genpy.Message):
    ret: int
    message: str
    def __init__(
        self,
        ret: int = ...,
        message: str = ...,
    ) -> None: ...

class SetCollision:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[SetCollisionRequest]]
    _response_class: ClassVar[type[SetCollisionResponse]]

class SetCollisionRequest(genpy.Message):
    is_enable: bool
    value: int
    def __init__(
        self,
        is_enable: bool = ...,
        value: int = ...,
    ) -> None: ...

class SetCollisionResponse(genpy.Message):
    ret: int
    message: str
    def __init__(
        self,
        ret: int = ...,
        message: str = ...,
    ) -> None: ...

class SetIO:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[SetIORequest]]
    _response_class: ClassVar[type[SetIOResponse]]

class SetIORequest(genpy.Message):
    signal: str
    type: int
    index: int
    value: float
    def __init__(
        self,
        signal: str = ...,
        type: int = ...,
        index: int = ...,
        value: float = ...,
    ) -> None: ...

class SetIOResponse(genpy.Message):
    ret: int
    message: str
    def __init__(
        self,
        ret: int = ...,
        message: str = ...,
    ) -> None: ...

class SetPayload:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[SetPayloadRequest]]
    _response_class: ClassVar[type[SetPayloadResponse]]

class SetPayloadRequest(genpy.Message):
    tool_num: int
    mass: float
    xc: float
    yc: float
    zc: float
    def __init__(
        self,
        tool_num: int = ...,
        mass: float = ...,
        xc: float = ...,
        yc: float = ...,
        zc: float = ...,
    ) -> None: ...

class SetPayloadResponse(genpy.Message):
    ret: int
    message: str
    def __init__(
        self,
        ret: int = ...,
        message: str = ...,
    ) -> None: ...

class SetSpeedSlider:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[SetSpeedSliderRequest]]
    _response_class: ClassVar[type[SetSpeedSliderResponse]]

class SetSpeedSliderRequest(genpy.Message):
    speed_slider_fraction: float
    def __init__(
        self,
        speed_slider_fraction: float = ...,
    ) -> None: ...

class SetSpeedSliderResponse(genpy.Message):
    success: bool
    message: str
    def __init__(
        self,
        success: bool = ...,
        message: str = ...,
    ) -> None: ...

class SetTcpFrame:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[SetTcpFrameRequest]]
    _response_class: ClassVar[type[SetTcpFrameResponse]]

class SetTcpFrameRequest(genpy.Message):
    pose: Sequence[float]
    tool_num: int
    def __init__(
        self,
        pose: Sequence[float] = ...,
        tool_num: int = ...,
    ) -> None: ...

class SetTcpFrameResponse(genpy.Message):
    ret: int
    message: str
    def __init__(
        self,
        ret: int = ...,
        message: str = ...,
    ) -> None: ...

class SetUserFrame:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[SetUserFrameRequest]]
    _response_class: ClassVar[type[SetUserFrameResponse]]

class SetUserFrameRequest(genpy.Message):
    pose: Sequence[float]
    user_num: int
    def __init__(
        self,
        pose: Sequence[float] = ...,
        user_num: int = ...,
    ) -> None: ...

class SetUserFrameResponse(genpy.Message):
    ret: int
    message: str
    def __init__(
        self,
        ret: int = ...,
        message: str = ...,
    ) -> None: ...

class SetWorkspace:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[SetWorkspaceRequest]]
    _response_class: ClassVar[type[SetWorkspaceResponse]]

class SetWorkspaceRequest(genpy.Message):
    yaml: str
    def __init__(
        self,
        yaml: str = ...,
    ) -> None: ...

class SetWorkspaceResponse(genpy.Message):
    ret: int
    message: str
    yaml: str
    def __init__(
        self,
        ret: int = ...,
        message: str = ...,
        yaml: str = ...,
    ) -> None: ...
