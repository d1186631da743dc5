# HYBRID_SLAM_CUDA: the engine of SIFT for CUDA devices. AUTO: where there is a driver to run it and a
# compiler for it (without a driver it would only cost time); ON: configuring fails without a compiler;
# OFF. Sets HS_WITH_CUDA.
set(HYBRID_SLAM_CUDA AUTO CACHE STRING "SIFT on CUDA devices: AUTO, ON or OFF")
set_property(CACHE HYBRID_SLAM_CUDA PROPERTY STRINGS AUTO ON OFF)

if(HYBRID_SLAM_CUDA STREQUAL "AUTO")
  if(EXISTS /proc/driver/nvidia/version OR EXISTS /dev/nvidiactl OR EXISTS /dev/dxg)
    include(CheckLanguage)
    check_language(CUDA)
    if(CMAKE_CUDA_COMPILER)
      set(HS_WITH_CUDA ON)
    endif()
  endif()
elseif(HYBRID_SLAM_CUDA)
  set(HS_WITH_CUDA ON)
endif()
if(HS_WITH_CUDA)
  include(cuda_language)
endif()
message(STATUS "SIFT on CUDA devices: ${HS_WITH_CUDA} (HYBRID_SLAM_CUDA: ${HYBRID_SLAM_CUDA})")
