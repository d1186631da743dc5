# Everything comes from Debian 12. Why each one is here: docs/architecture.md.
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(Ceres 2.1 REQUIRED)
find_package(OpenCV 4.6 REQUIRED COMPONENTS core imgproc imgcodecs features2d calib3d video)
find_package(PNG REQUIRED)
find_package(JPEG REQUIRED)
find_package(TIFF REQUIRED)
find_package(spdlog REQUIRED)
find_package(fmt REQUIRED)
find_package(CLI11 REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(Threads REQUIRED)
find_package(OpenMP REQUIRED COMPONENTS CXX)
find_library(BLAS_LIBRARY blas REQUIRED)

find_package(PkgConfig REQUIRED)
pkg_check_modules(hwy REQUIRED IMPORTED_TARGET libhwy)
pkg_check_modules(xxhash REQUIRED IMPORTED_TARGET libxxhash)
pkg_check_modules(zstd REQUIRED IMPORTED_TARGET libzstd)

find_path(OPENGV_INCLUDE_DIR opengv/types.hpp REQUIRED)
find_library(OPENGV_LIBRARY opengv REQUIRED)
add_library(opengv::opengv UNKNOWN IMPORTED)
set_target_properties(opengv::opengv PROPERTIES
  IMPORTED_LOCATION ${OPENGV_LIBRARY}
  INTERFACE_INCLUDE_DIRECTORIES ${OPENGV_INCLUDE_DIR})

if(HYBRID_SLAM_RENDERER)
  find_package(embree 3 REQUIRED)
endif()

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
endif()
