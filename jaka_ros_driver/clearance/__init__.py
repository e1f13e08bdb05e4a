"""The distances of the arm from itself and from what stands around it. No ROS, no protocol, no clock.

shape             an arm as capsules, made of its DH table
workspace         keep-out and keep-in boxes, a floor, cylinders and the tool, from a YAML file
distances         distances between segments, and of a segment from a solid
solids            the capsules as cylinders and balls, in the frames of the links
collision_urdf    they as collision geometry of the generated URDF
guard             the nearest pair of a joint position, and the first trouble on a path
"""
