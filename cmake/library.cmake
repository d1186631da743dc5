# The targets that users link, one for each component: hybrid_slam::cameras, hybrid_slam::slam, ... The same by
# find_package, add_subdirectory and FetchContent. docs/using_as_a_library.md tells how.

set(HS_LIBRARIES_OF_cameras hs_geometry hs_cameras hs_files hs_calibration)
set(HS_LIBRARIES_OF_map hs_feature_types hs_map)
set(HS_LIBRARIES_OF_factors hs_factors)
set(HS_LIBRARIES_OF_backend hs_problem hs_incremental hs_backend)
set(HS_LIBRARIES_OF_features hs_features hs_sift_device hs_matching)
set(HS_LIBRARIES_OF_slam hs_pose hs_rig_calibration hs_odometry hs_place_recognition hs_default_vocabulary hs_tracking hs_mapping
    hs_bags hs_input hs_parallel hs_slam hs_io)
if(HS_WITH_CUDA)
  list(PREPEND HS_LIBRARIES_OF_features hs_cuda_features)
endif()

# Users write <hybrid_slam/cameras/camera.h> wherever the headers are.
set(HS_PREFIXED ${PROJECT_BINARY_DIR}/include)
foreach(folder source generated)
  file(MAKE_DIRECTORY ${HS_PREFIXED}/${folder})
endforeach()
file(CREATE_LINK ${PROJECT_SOURCE_DIR} ${HS_PREFIXED}/source/hybrid_slam SYMBOLIC)
file(CREATE_LINK ${PROJECT_BINARY_DIR}/generated ${HS_PREFIXED}/generated/hybrid_slam SYMBOLIC)

foreach(component IN LISTS HS_COMPONENTS)
  set(target hybrid_slam_${component})
  add_library(${target} INTERFACE)
  add_library(hybrid_slam::${component} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${component})
  target_compile_features(${target} INTERFACE cxx_std_20)
  target_include_directories(${target} INTERFACE
    $<BUILD_INTERFACE:${HS_PREFIXED}/source> $<BUILD_INTERFACE:${HS_PREFIXED}/generated>
    $<INSTALL_INTERFACE:include>)
  target_link_libraries(${target} INTERFACE ${HS_LIBRARIES_OF_${component}})
  foreach(below IN LISTS hybrid_slam_${component}_components)
    target_link_libraries(${target} INTERFACE hybrid_slam_${below})
  endforeach()
endforeach()

if(HYBRID_SLAM_INSTALL)
  include(install)
endif()
