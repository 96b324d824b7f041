# What `cmake --install` and `cpack -G DEB` give. Two components: `commands` (package roomtex) and `development`
# (package roomtex-dev: libraries, headers and what find_package(roomtex) reads).
include(CMakePackageConfigHelpers)
set(roomtex_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/roomtex)

# roomtex_install_library(NAME ROOMS folders... [EXCEPT files...]): the library as roomtex::NAME, with the headers
# of its rooms. They keep their folders below include/roomtex, so that a user's includes read as ours.
function(roomtex_install_library name)
  cmake_parse_arguments(ARG "" "" "ROOMS;EXCEPT" ${ARGN})
  set_target_properties(roomtex_${name} PROPERTIES EXPORT_NAME ${name})
  target_compile_features(roomtex_${name} PUBLIC cxx_std_17)
  install(TARGETS roomtex_${name} EXPORT roomtex_targets
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development
          INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/roomtex)
  list(TRANSFORM ARG_EXCEPT REPLACE "[.]cc$" ".h")
  get_filename_component(folder ${CMAKE_CURRENT_SOURCE_DIR} NAME)
  foreach(room ${ARG_ROOMS})
    file(GLOB headers CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} ${room}/*.h)
    if(ARG_EXCEPT)
      list(REMOVE_ITEM headers ${ARG_EXCEPT})
    endif()
    install(FILES ${headers} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/roomtex/${folder}/${room}
            COMPONENT development)
  endforeach()
endfunction()

# After all libraries: the package that find_package(roomtex) reads, and the documents.
function(roomtex_install_package)
  install(EXPORT roomtex_targets NAMESPACE roomtex:: FILE roomtexTargets.cmake
          DESTINATION ${roomtex_package_dir} COMPONENT development)
  configure_package_config_file(${PROJECT_SOURCE_DIR}/scripts/cmake/roomtexConfig.cmake.in
    ${CMAKE_BINARY_DIR}/generated/roomtexConfig.cmake INSTALL_DESTINATION ${roomtex_package_dir})
  # Until 1.0 a minor version may change the interface.
  write_basic_package_version_file(${CMAKE_BINARY_DIR}/generated/roomtexConfigVersion.cmake
    COMPATIBILITY SameMinorVersion)
  install(FILES ${CMAKE_BINARY_DIR}/generated/roomtexConfig.cmake
                ${CMAKE_BINARY_DIR}/generated/roomtexConfigVersion.cmake
                ${PROJECT_SOURCE_DIR}/scripts/cmake/geographiclib.cmake
          DESTINATION ${roomtex_package_dir} COMPONENT development)
  install(FILES README.md CHANGELOG.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT commands)
  # What README and messages name as docs/NAME.md; pictures are for who reads them in the source.
  install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT commands FILES_MATCHING PATTERN "*.md"
          PATTERN images EXCLUDE PATTERN examples EXCLUDE)
  # Where Debian looks for the licence of a package.
  install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/roomtex RENAME copyright COMPONENT commands)
  install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/roomtex-dev RENAME copyright
          COMPONENT development)
endfunction()

# cpack -G DEB. scripts/check_package.sh installs the packages on a bare Debian 12.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME roomtex)
set(CPACK_PACKAGE_VENDOR roomtex)
set(CPACK_PACKAGE_CONTACT "roomtex developers <roomtex@example.invalid>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "colour photos onto a laser range scan of a room")
set(CPACK_COMPONENTS_ALL commands development)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_COMMANDS_PACKAGE_NAME roomtex)
set(CPACK_DEBIAN_COMMANDS_PACKAGE_SECTION science)
set(CPACK_DEBIAN_COMMANDS_DESCRIPTION
    "colour photos onto a laser range scan of a room
A COLMAP extension toolkit: commands that start COLMAP's mapper well, place its
sparse model in a range scan of a room by a few clicks, and blend the photos
onto the scan with care for occlusion, exposure and detail.")
# The libraries that the commands are linked with are found by dpkg-shlibdeps; roomtex-mapper runs COLMAP, and
# roomtex-pick and roomtex-view open a browser if there is one.
set(CPACK_DEBIAN_COMMANDS_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_COMMANDS_PACKAGE_DEPENDS "colmap (>= 3.7)")
set(CPACK_DEBIAN_COMMANDS_PACKAGE_RECOMMENDS xdg-utils)
set(CPACK_DEBIAN_COMMANDS_PACKAGE_SUGGESTS "cloudcompare | meshlab, snakemake")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME roomtex-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION
    "libraries that colour photos onto a laser range scan
Static libraries, headers and the CMake package of roomtex: reading scans and
COLMAP models, aligning one to the other, colouring scans from photos.")
# What roomtexConfig.cmake finds.
string(JOIN ", " CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
  libeigen3-dev nlohmann-json3-dev libcli11-dev libopencv-dev libceres-dev libembree-dev libgeographiclib-dev
  libsqlitecpp-dev libsqlite3-dev libpugixml-dev libfmt-dev libexiv2-dev libpcl-dev libtinygltf-dev libmeshoptimizer-dev pkg-config)
include(CPack)
