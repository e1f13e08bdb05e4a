"""The arm's geometry: models, forward and inverse kinematics, the limits audit. No ROS, no protocol.

rotations         orientations and rigid transforms, the convention in each name
arm_models        per arm: DH parameters, limits, speeds, from a data file, each with its source
forward           joint angles to flange pose; Jacobian; distances to singularities
closed_forms      closed-form inverse kinematics of the families that have one
numeric_inverse   inverse kinematics where no closed form holds
inverse           flange pose to joint angles
pose_check        the controller's pose of the tool beside a model's
limits            the audit that every command passes before anything is sent
urdf              a URDF whose kinematics equal ours
"""
