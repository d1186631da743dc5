# cpack makes Debian packages: hybrid-slam (the programs), hybrid-slam-live (what opens cameras),
# libhybrid-slam-dev and, where it is built, python3-hybrid-slam. The target "packaged" builds what goes into them. ./run package does all of it.

set(HS_PROGRAMS hybrid_slam map_optimizer map_tool trajectory_eval vocabulary_trainer feature_eval)
if(HYBRID_SLAM_RENDERER)
  list(APPEND HS_PROGRAMS scene_renderer)
endif()
add_custom_target(packaged DEPENDS ${HS_PROGRAMS} stream_capture)
foreach(component IN LISTS HS_COMPONENTS)
  foreach(library IN LISTS HS_LIBRARIES_OF_${component})
    get_target_property(type ${library} TYPE)
    if(NOT type STREQUAL "INTERFACE_LIBRARY")
      add_dependencies(packaged ${library})
    endif()
  endforeach()
endforeach()
set(packages programs live dev)
if(HS_WITH_PYTHON)
  add_dependencies(packaged hs_python)
  list(APPEND packages python)
endif()

install(TARGETS ${HS_PROGRAMS} RUNTIME DESTINATION bin COMPONENT programs)
# A package of its own, as it brings along all that OpenCV opens cameras and videos with.
install(TARGETS stream_capture RUNTIME DESTINATION libexec/hybrid_slam COMPONENT live)
install(FILES frontend/place_recognition/default_vocabulary.voc DESTINATION share/hybrid_slam COMPONENT programs)
foreach(program IN LISTS HS_PROGRAMS)
  install(FILES packaging/completion.bash DESTINATION share/bash-completion/completions RENAME ${program}
          COMPONENT programs)
endforeach()

# A man page is what a program, or one of its commands, says of itself.
find_program(HELP2MAN help2man)
find_program(GZIP gzip)
function(man_page name program purpose)  # [COMMAND]
  set(page ${PROJECT_BINARY_DIR}/man/${name}.1)
  string(STRIP "${ARGN} --help" help)
  add_custom_command(OUTPUT ${page}.gz
    COMMAND ${CMAKE_COMMAND} -E make_directory ${PROJECT_BINARY_DIR}/man
    COMMAND ${HELP2MAN} --no-info --section 1 --source "hybrid_slam ${PROJECT_VERSION}" --name ${purpose}
            --help-option ${help} --version-string "${name} ${PROJECT_VERSION}" --output ${page} $<TARGET_FILE:${program}>
    COMMAND ${GZIP} --best --no-name --force ${page}
    DEPENDS ${program} VERBATIM)
  set_property(GLOBAL APPEND PROPERTY HS_MAN_PAGES ${page}.gz)
endfunction()
if(HELP2MAN AND GZIP)
  man_page(hybrid_slam hybrid_slam "visual SLAM of a stereo pair and a fisheye")
  man_page(hybrid_slam-live hybrid_slam "visual SLAM on what cameras see now" live)
  man_page(hybrid_slam-check hybrid_slam "what a dataset is fit for" check)
  man_page(map_optimizer map_optimizer "bundle adjustment of a map or a problem in a file")
  man_page(map_tool map_tool "looks into maps, checks, cuts, exports and merges them")
  man_page(trajectory_eval trajectory_eval "compares a trajectory with the true one")
  man_page(vocabulary_trainer vocabulary_trainer "makes vocabularies for finding places again")
  man_page(feature_eval feature_eval "how well features of images match")
  if(HYBRID_SLAM_RENDERER)
    man_page(scene_renderer scene_renderer "renders datasets with exact truth")
  endif()
  get_property(pages GLOBAL PROPERTY HS_MAN_PAGES)
  add_custom_target(man_pages DEPENDS ${pages})
  add_dependencies(packaged man_pages)
  install(FILES ${pages} DESTINATION share/man/man1 COMPONENT programs OPTIONAL)
endif()

set(name_of_programs hybrid-slam)
set(name_of_live hybrid-slam-live)
set(name_of_dev libhybrid-slam-dev)
set(name_of_python python3-hybrid-slam)
foreach(package IN LISTS packages)
  install(FILES packaging/copyright DESTINATION share/doc/${name_of_${package}} COMPONENT ${package})
  string(TOUPPER ${package} upper)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${name_of_${package}})
endforeach()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME hybrid-slam)
set(CPACK_PACKAGE_VENDOR "the hybrid_slam developers")
set(CPACK_PACKAGE_CONTACT "the hybrid_slam developers <hybrid-slam@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Visual SLAM of a stereo pair and an independently moving fisheye")
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_COMPONENTS_ALL ${packages})
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SHLIBDEPS ON)
# Not the reference BLAS, which is slow, nor one whose threads make sums depend on their number.
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_RECOMMENDS libopenblas0-serial)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SUGGESTS "ffmpeg, hybrid-slam-live")  # videos; cameras and streams
set(CPACK_DEBIAN_LIVE_PACKAGE_SECTION science)
set(CPACK_DEBIAN_LIVE_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_LIVE_PACKAGE_DEPENDS "hybrid-slam (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_LIVE_DESCRIPTION "Cameras and streams for hybrid_slam live")
set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS libopenblas0-serial)
set(CPACK_DEBIAN_PROGRAMS_DESCRIPTION "Programs for visual SLAM, bundle adjustment and their evaluation")
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_DESCRIPTION "The library of hybrid_slam: headers, static archives, CMake package")
# What users of static archives link as well: the packages of cmake/components.cmake.
string(JOIN ", " CPACK_DEBIAN_DEV_PACKAGE_DEPENDS libeigen3-dev libceres-dev libsuitesparse-dev libopencv-dev
  libpng-dev libjpeg62-turbo-dev libtiff-dev libopengv-dev libhwy-dev libxxhash-dev libzstd-dev libbz2-dev
  liblz4-dev libsqlite3-dev zlib1g-dev libspdlog-dev libfmt-dev libyaml-cpp-dev nlohmann-json3-dev pkg-config)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PYTHON_DESCRIPTION "hybrid_slam for Python: sessions, cameras, maps, trajectories, factor graphs")
if(HS_WITH_PYTHON)
  math(EXPR next "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
      "python3 (>= 3.${Python_VERSION_MINOR}~), python3 (<< 3.${next}), python3-numpy")
endif()
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/packaging/postinst
    ${PROJECT_SOURCE_DIR}/packaging/prerm)
include(CPack)
