# The components of the library: what each builds on, and which packages of others it asks for. Read by our
# own build and, installed, by find_package(hybrid_slam). Why each package is here: docs/architecture.md.

set(hybrid_slam_components cameras map factors backend features slam)

set(hybrid_slam_cameras_packages "Eigen3 3.4 NO_MODULE" yaml-cpp)

set(hybrid_slam_map_components cameras)
set(hybrid_slam_map_modules xxhash zstd)

set(hybrid_slam_factors_components cameras)
set(hybrid_slam_factors_packages "Ceres 2.1")

set(hybrid_slam_backend_components map factors)
set(hybrid_slam_backend_packages "OpenMP COMPONENTS CXX")  # glog and SuiteSparse come with Ceres

set(hybrid_slam_features_components map)
set(hybrid_slam_features_packages "OpenCV 4.6 COMPONENTS core imgproc video")
set(hybrid_slam_features_modules hwy)

set(hybrid_slam_slam_components backend features)
set(hybrid_slam_slam_packages "OpenCV 4.6 COMPONENTS core imgproc calib3d" JPEG PNG TIFF BZip2 SQLite3 ZLIB
    spdlog fmt nlohmann_json Threads opengv)
set(hybrid_slam_slam_modules lz4)

# The components that are asked for and all that they build on, lowest first. Unknown names are left out.
function(hybrid_slam_closure out)
  set(wanted ${ARGN})
  set(known ${hybrid_slam_components})
  list(REVERSE known)
  foreach(component IN LISTS known)
    if(component IN_LIST wanted)
      list(APPEND wanted ${hybrid_slam_${component}_components})
    endif()
  endforeach()
  set(closure "")
  foreach(component IN LISTS hybrid_slam_components)
    if(component IN_LIST wanted)
      list(APPEND closure ${component})
    endif()
  endforeach()
  set(${out} ${closure} PARENT_SCOPE)
endfunction()
