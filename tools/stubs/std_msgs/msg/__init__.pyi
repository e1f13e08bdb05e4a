# Made by test/support/pages/message_stubs.py.
from typing import Sequence

import genpy

class Bool(genpy.Message):
    data: bool
    def __init__(
        self,
        data: bool = ...,
    ) -> None: ...

class Float64(genpy.Message):
    data: float
    def __init__(
        self,
        data: float = ...,
    ) -> None: ...

class Float64MultiArray(genpy.Message):
    layout: MultiArrayLayout
    data: Sequence[float]
    def __init__(
        self,
        layout: MultiArrayLayout = ...,
        data: Sequence[float] = ...,
    ) -> None: ...

class Header(genpy.Message):
    seq: int
    stamp: genpy.Time
    frame_id: str
    def __init__(
        self,
        seq: int = ...,
        stamp: genpy.Time = ...,
        frame_id: str = ...,
    ) -> None: ...

class MultiArrayDimension(genpy.Message):
    label: str
    size: int
    stride: int
    def __init__(
        self,
        label: str = ...,
        size: int = ...,
        stride: int = ...,
    ) -> None: ...

class MultiArrayLayout(genpy.Message):
    dim: Sequence[MultiArrayDimension]
    data_offset: int
    def __init__(
        self,
        dim: Sequence[MultiArrayDimension] = ...,
        data_offset: int = ...,
    ) -> None: ...
