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
  set(check ${PYTHON_EXECUTABLE} ${PROJECT_SOURCE_DIR}/cmake/check_jaka_msgs_is_alone.py
    ${PROJECT_SOURCE_DIR}/jaka_msgs ${workspace_source})
  execute_process(COMMAND ${check} RESULT_VARIABLE check_failed ERROR_VARIABLE check_error)
  if(check_failed)
    message(FATAL_ERROR "\n${check_error}")
  endif()
  add_custom_target(check_jaka_msgs_is_alone ALL COMMAND ${check})  # a second one may come after the first build
endif()

add_subdirectory(jaka_msgs)
