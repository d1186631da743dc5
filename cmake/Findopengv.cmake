# opengv comes without a CMake package: the target opengv::opengv.
find_path(OPENGV_INCLUDE_DIR opengv/types.hpp)
find_library(OPENGV_LIBRARY opengv)
mark_as_advanced(OPENGV_INCLUDE_DIR OPENGV_LIBRARY)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(opengv REQUIRED_VARS OPENGV_LIBRARY OPENGV_INCLUDE_DIR)
if(opengv_FOUND AND NOT TARGET opengv::opengv)
  add_library(opengv::opengv UNKNOWN IMPORTED)
  set_target_properties(opengv::opengv PROPERTIES
    IMPORTED_LOCATION ${OPENGV_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${OPENGV_INCLUDE_DIR})
endif()
