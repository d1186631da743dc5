# Where things go under CMAKE_INSTALL_PREFIX. Install components, which become Debian packages: programs, dev,
# python (apps/python).
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(HS_PACKAGE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/hybrid_slam)
foreach(component IN LISTS HS_COMPONENTS)
  install(TARGETS ${HS_LIBRARIES_OF_${component}} hybrid_slam_${component} EXPORT hybrid_slam-${component}
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/hybrid_slam COMPONENT dev)
  install(EXPORT hybrid_slam-${component} NAMESPACE hybrid_slam:: DESTINATION ${HS_PACKAGE_DIR} COMPONENT dev)
endforeach()
install(DIRECTORY cameras factors backend frontend DESTINATION include/hybrid_slam COMPONENT dev
        FILES_MATCHING PATTERN *.h)
install(DIRECTORY apps/slam apps/io DESTINATION include/hybrid_slam/apps COMPONENT dev
        FILES_MATCHING PATTERN *.h PATTERN graphs EXCLUDE PATTERN live EXCLUDE)
install(FILES ${PROJECT_BINARY_DIR}/generated/apps/slam/version.h DESTINATION include/hybrid_slam/apps/slam
        COMPONENT dev)
configure_package_config_file(cmake/hybrid_slam-config.cmake.in hybrid_slam-config.cmake
                              INSTALL_DESTINATION ${HS_PACKAGE_DIR})
# Before 1.0 each minor version may change the interface.
write_basic_package_version_file(hybrid_slam-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/hybrid_slam-config.cmake
              ${CMAKE_CURRENT_BINARY_DIR}/hybrid_slam-config-version.cmake
              cmake/components.cmake cmake/Findopengv.cmake
        DESTINATION ${HS_PACKAGE_DIR} COMPONENT dev)

if(HYBRID_SLAM_PROGRAMS)
  include(packaging)
endif()
