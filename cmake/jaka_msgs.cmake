# Builds the nested jaka_msgs, or takes the one of the workspace where JAKA_MSGS_EXTERNAL=1 asks for it.
#
# The arm's maker has a package of the same name. With both in one workspace catkin_make fails on a doubled target, and
# isolated builds mix the generated code of the two without a word, so a second one is an error here.
# Sets jaka_msgs_external_depend to "jaka_msgs" or "".

# The environment variable, because package.xml's condition reads it too.
if("$ENV{JAKA_MSGS_EXTERNAL}" STREQUAL "1")
  find_package(jaka_msgs QUIET)
  if(NOT jaka_msgs_FOUND)
    message(FATAL_ERROR "JAKA_MSGS_EXTERNAL=1 asks for a jaka_msgs from outside, and CMake finds none.
Put one into the workspace or on CMAKE_PREFIX_PATH, or unset JAKA_MSGS_EXTERNAL to build the one in
${PROJECT_SOURCE_DIR}/jaka_msgs")
  endif()
  message(STATUS "jaka_msgs: taken from ${jaka_msgs_DIR} (JAKA_MSGS_EXTERNAL=1)")
  set(jaka_msgs_external_depend jaka_msgs)
  return()
endif()
set(jaka_msgs_external_depend "")

# The source folder of the workspace: that of catkin_make's own project, or, for the isolated builders, src beside the
# build folder under the workspace's marker file. A plain cmake build of this package alone has none.
set(workspace_source "")
if(NOT CMAKE_SOURCE_DIR STREQUAL PROJECT_SOURCE_DIR)
  set(workspace_source ${CMAKE_SOURCE_DIR})
else()
  set(folder ${PROJECT_BINARY_DIR})
  set(below "")
  while(NOT folder STREQUAL below)
    if(EXISTS ${folder}/.catkin_workspace OR EXISTS ${folder}/.catkin_tools)
      set(workspace_source ${folder}/src)
      break()
    endif()
    set(below ${folder})
    get_filename_component(folder ${folder} PATH)
  endwhile()
endif()

if(IS_DIRECTORY "${workspace_source}")
  # catkin's own crawl: it honours CATKIN_IGNORE, follows links, and does not see the nested package.
  execute_process(
    COMMAND ${PYTHON_EXECUTABLE} -c "import sys
from catkin_pkg.packages import find_packages
sys.stdout.write(';'.join(sys.argv[1] + '/' + path for path, package in find_packages(sys.argv[1]).items() if package.name == 'jaka_msgs'))"
      ${workspace_source}
    OUTPUT_VARIABLE other_jaka_msgs RESULT_VARIABLE crawl_failed)
  if(crawl_failed)
    message(FATAL_ERROR "cannot look for a second jaka_msgs in ${workspace_source}")
  endif()
  if(other_jaka_msgs)
    message(FATAL_ERROR "this workspace holds two packages named jaka_msgs:
  ${PROJECT_SOURCE_DIR}/jaka_msgs
  ${other_jaka_msgs}
Their generated code would get mixed. Keep one of them:
  - that of jaka_ros_driver:  touch ${other_jaka_msgs}/CATKIN_IGNORE
  - the other one:            export JAKA_MSGS_EXTERNAL=1
and build again from an empty build and devel folder.")
  endif()
endif()

add_subdirectory(jaka_msgs)
