"""The requests of the maker's SDK 2.1.14, and the keys it reads in each reply (docs/sdk-client.md section 9)."""
from pathlib import Path

REQUESTS = Path(__file__).resolve().parents[1] / "data" / "sdk" / "requests-2.1.14.txt"

NUMBER, FLAG, TEXT, OBJECT, LIST = "number", "0, 1 or bool", "text", "object", "list"
SIGNALS = "a list of lists: text and five numbers"


def numbers(count):
    return [NUMBER] * count


def rows(count, length):
    return [numbers(length)] * count


OBSERVED, KEPT, GUESS = "observed", "observed with 2.1.11", "guess"
# command -> (evidence, what is read). A command that is not here is answered with its error code only.
READS = {
    "is_on_limit": (OBSERVED, {"on_limit": FLAG}),
    "get_rapid_rate": (OBSERVED, {"value": NUMBER}),
    "get_drag_status": (OBSERVED, {"status": FLAG}),
    "get_exist_traj_file_name": (OBSERVED, {"trajTrackFileName": LIST}),
    "get_admit_ctrl_config": (OBSERVED, {"admitConfig": rows(6, 5)}),
    "emergency_stop_status": (OBSERVED, {"emergency_stop": FLAG}),
    "protective_stop_status": (OBSERVED, {"protective_stop": FLAG}),
    "get_digital_input": (OBSERVED, {"value": NUMBER}),
    "get_digital_output": (OBSERVED, {"value": NUMBER}),
    "get_analog_input": (OBSERVED, {"value": NUMBER}),
    "get_analog_output": (OBSERVED, {"value": NUMBER}),
    "get_motion_state": (OBSERVED, {
        "inpos": FLAG, "paused": FLAG, "queue": NUMBER, "active_queue": NUMBER, "motion_line": NUMBER,
        "err_add_line": NUMBER, "queue_full": FLAG, "isOnLimit": FLAG, "isInEstop": FLAG, "isInCollision": FLAG}),
    "get_joint_pos": (OBSERVED, {"joint_pos": numbers(6)}),
    "get_tcp_pos": (OBSERVED, {"tcp_pos": numbers(6)}),
    "get_curr_tool_id": (OBSERVED, {"id": NUMBER}),
    "get_curr_user_id": (OBSERVED, {"id": NUMBER}),
    "get_version": (KEPT, {"version": TEXT, "robot_name": TEXT, "robot_id": TEXT}),
    "get_tool_offsets": (KEPT, {"tool_offsets": rows(16, 6)}),
    "get_user_offsets": (KEPT, {"user_offsets": rows(16, 6)}),
    "get_clsn_sensitivity": (KEPT, {"sensitivityLevel": NUMBER}),
    "get_payload": (KEPT, {"mass": NUMBER, "centroid": numbers(3)}),
    "get_tool_payload": (KEPT, {"mass": NUMBER, "centroid": numbers(3)}),
    "kine_forward": (KEPT, {"cartPosition": numbers(6)}),
    "kine_inverse": (KEPT, {"jointPosition": numbers(6)}),
    "get_program_state": (KEPT, {"programState": TEXT}),
    "get_loaded_program": (KEPT, {"programName": TEXT}),
    "get_current_line": (KEPT, {"current_line": NUMBER}),
    "get_dh_param": (KEPT, {"dh_param": rows(4, 6)}),
    "get_installation_angle": (KEPT, {"installation_angle": [numbers(4), numbers(3)]}),
    "get_extio_status": (KEPT, {"extio_status": OBJECT}),
    "is_in_servomove": (KEPT, {"in_servomove": FLAG}),
    "query_user_defined_variable": (GUESS, {"var_list": LIST}),
    "get_tio_signals": (OBSERVED, {"signals": SIGNALS}),
    "get_tio_vout_param": (GUESS, {"tio_vout_ena": NUMBER, "tio_vout_vol": NUMBER}),
    "get_tio_pin_mode": (GUESS, {"pinMode": NUMBER}),
    "get_rs485_chn_mode": (GUESS, {"chnMode": NUMBER}),
    "get_rs485_chn_comm": (GUESS, {
        "slaveId": NUMBER, "baudrate": NUMBER, "databit": NUMBER, "stopbit": NUMBER, "parity": NUMBER}),
    "get_motion_limit_warning_range": (GUESS, {"range_level": NUMBER}),
    "get_torsenosr_brand": (GUESS, {"sensor_brand": NUMBER}),
    "get_compliant_type": (GUESS, {"sensor_compensation": NUMBER, "compliance_type": NUMBER}),
    "get_torque_sensor_comm": (GUESS, {"type": NUMBER, "ip_addr": TEXT, "port": NUMBER}),
    "get_torque_sensor_filter": (GUESS, {"torqueSensorFilter": NUMBER}),
    "get_torque_sensor_soft_limit": (GUESS, {"torqueSensorSoftLimit": OBJECT}),
    "get_ft_ctrl_frame": (GUESS, {"ftFrame": NUMBER}),
    "get_traj_config": (GUESS, {"acc": NUMBER, "rpy_interval": NUMBER, "vel": NUMBER, "xyz_interval": NUMBER}),
    "get_traj_sample_status": (GUESS, {"sampleStatus": NUMBER}),
    "get_torq_sensor_identify_staus": (GUESS, {"identify_status": NUMBER}),
    "get_torq_sensor_payload_identify_result": (GUESS, {"mass": NUMBER, "centroid": numbers(3)}),
    "get_tool_drive_stat": (GUESS, {"tool_drive_stat": NUMBER}),
    "get_tool_drive_config": (GUESS, {
        "axis": numbers(6), "opt": numbers(6), "rigidity": numbers(6), "rebound": numbers(6)}),
    "get_tool_drive_frame": (GUESS, {"toolDragFrame": NUMBER}),
    "get_fusion_drive_sensitivity_level": (GUESS, {"sensitivity_level": NUMBER}),
    "get_compliant_speed_limit": (GUESS, {"speed_limit": NUMBER, "angular_speed_limit": NUMBER}),
    "get_torque_ref_point": (GUESS, {"ref_point": NUMBER}),
    "get_end_sensor_sensitivity_threshold": (GUESS, {"threshold_percent": numbers(6)}),
    "get_torque_sensor_data": (GUESS, {"type": NUMBER, "torque_sensor_data": numbers(6)}),
}
ROBOT_STATE = {
    "1.5.14": (OBSERVED, {"enable": TEXT, "power": TEXT}),
    "1.7": (OBSERVED, {"enable": FLAG, "power": FLAG, "errcode": NUMBER}),
}
# A piece of the request's text -> the error code with which a controller refuses it.
REFUSED = {
    '"jointPosition":[5729.577951308233,': "2",
    '"cartPosition":[5000.0,': "2",
    '"cartPosition":[9000.0,': "-4",
    '"get_digital_input","index":1,"type":3': "2",
}
WHY_REFUSED = {
    "joint_move": "targets outside the limits", "moveL": "targets outside the reach",
    "kine_inverse": "targets outside the reach", "get_digital_input": "relays, which are outputs"}


def requests():
    """Return (command, bytes of the request), each once."""
    lines = REQUESTS.read_text(encoding="ascii").splitlines()
    return [(name, text.encode("ascii")) for name, text in (line.split("\t") for line in lines)]


def refusal(request):
    return next((code for piece, code in REFUSED.items() if piece in request.decode("ascii")), "0")


def read_in(command, firmware):
    """Return evidence and keys of a command's reply."""
    if command == "get_robot_state":
        return ROBOT_STATE["1.5.14" if firmware == "1.5.14" else "1.7"]
    return READS.get(command, ("error code only", {}))


def has_shape(value, shape):
    if isinstance(shape, list):
        return isinstance(value, list) and len(value) == len(shape) and all(map(has_shape, value, shape))
    if shape == SIGNALS:
        return isinstance(value, list) and all(has_shape(row, [TEXT, *numbers(5)]) for row in value)
    kinds = {NUMBER: (int, float), FLAG: (bool, int), TEXT: str, OBJECT: dict, LIST: list}
    return isinstance(value, kinds[shape]) and (shape is not FLAG or value in (0, 1)) \
        and not (shape is NUMBER and isinstance(value, bool))


def table_rows():
    """Return command, its answer on 1.5.14 and on 1.7, the keys read of it, evidence; for docs/simulation.md."""
    for command in sorted({name for name, _ in requests()}):
        answer = "as the SDK reads it"
        if command in WHY_REFUSED:
            answer += "; refused: " + WHY_REFUSED[command]
        evidence, old = read_in(command, "1.5.14")
        keys = ", ".join("`%s`" % key for key in old)
        modern = read_in(command, "1.7.2")[1]
        if modern != old:
            keys += "; 1.7: " + ", ".join("`%s`" % key for key in modern)
        yield ["`%s`" % command, answer, answer, keys, evidence]
