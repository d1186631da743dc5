# cmake -D SOURCE=... -D HYBRID_SLAM_VERSION=... -D TEMPLATE=... -D OUTPUT=... -P git_version.cmake
execute_process(COMMAND git -C ${SOURCE} describe --always --dirty --abbrev=12
  OUTPUT_VARIABLE HYBRID_SLAM_GIT_COMMIT OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
if(NOT HYBRID_SLAM_GIT_COMMIT)
  set(HYBRID_SLAM_GIT_COMMIT unknown)
endif()
configure_file(${TEMPLATE} ${OUTPUT} @ONLY)
