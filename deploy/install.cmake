# What `cmake --install` puts where. Components: programs, service, formats, decoder, documents.
# The programs' pages and the completion are made from their own --help, so they need the programs first; nothing that is
# installed depends on the tests, and `cmake --install` builds nothing by itself.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
find_package(Python3 COMPONENTS Interpreter REQUIRED)

set(PATINA_SYSTEMD_DIR lib/systemd/system CACHE STRING "Folder of systemd units, below the prefix or absolute")
set(pages ${CMAKE_BINARY_DIR}/docs)

# ---- Programs, their pages and completion ----
install(TARGETS patina patinad RUNTIME COMPONENT programs)
# Not for users to call: what `patina` becomes.
install(TARGETS patina_bake patina-view RUNTIME DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/patina COMPONENT programs)
set(made ${pages}/patina.1 ${pages}/patinad.8 ${pages}/patinad.json.5 ${pages}/patina.bash ${pages}/help.json)
add_custom_command(OUTPUT ${made}
  COMMAND ${Python3_EXECUTABLE} -B ${CMAKE_SOURCE_DIR}/deploy/docs/make_docs.py --patina $<TARGET_FILE:patina>
    --patinad $<TARGET_FILE:patinad> --schema ${CMAKE_SOURCE_DIR}/schemas/config.schema.json --out ${pages}
  DEPENDS patina patinad deploy/docs/make_docs.py deploy/docs/help_text.py schemas/config.schema.json
  COMMENT "Manual pages and completion" VERBATIM)
add_custom_target(patina_docs ALL DEPENDS ${made})
install(FILES ${pages}/patina.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT programs)
install(FILES ${pages}/patinad.8 DESTINATION ${CMAKE_INSTALL_MANDIR}/man8 COMPONENT programs)
install(FILES ${pages}/patinad.json.5 DESTINATION ${CMAKE_INSTALL_MANDIR}/man5 COMPONENT programs)
install(FILES ${pages}/patina.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME patina
  COMPONENT programs)

# ---- The service ----
file(READ deploy/systemd/patinad.service unit)
string(REPLACE "=/usr/bin/" "=${CMAKE_INSTALL_FULL_BINDIR}/" unit "${unit}")
string(REPLACE "/usr/share/doc/patina/" "${CMAKE_INSTALL_FULL_DOCDIR}/" unit "${unit}")
string(REPLACE "/etc/patina/" "${CMAKE_INSTALL_FULL_SYSCONFDIR}/patina/" unit "${unit}")
file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/systemd/patinad.service CONTENT "${unit}" @ONLY)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS deploy/systemd/patinad.service)
install(FILES ${CMAKE_BINARY_DIR}/systemd/patinad.service DESTINATION ${PATINA_SYSTEMD_DIR} COMPONENT service)
install(FILES deploy/systemd/patina.sysusers.conf DESTINATION lib/sysusers.d RENAME patina.conf COMPONENT service)
install(FILES deploy/systemd/patina.tmpfiles.conf DESTINATION lib/tmpfiles.d RENAME patina.conf COMPONENT service)
install(FILES deploy/systemd/patinad.json DESTINATION ${CMAKE_INSTALL_FULL_SYSCONFDIR}/patina COMPONENT service)

# ---- Schemas, shader cores, documents ----
install(DIRECTORY schemas/ DESTINATION ${CMAKE_INSTALL_DATADIR}/patina/schemas COMPONENT documents
  FILES_MATCHING PATTERN "*.json" PATTERN examples EXCLUDE PATTERN queue EXCLUDE)
install(DIRECTORY formats/decoder/ DESTINATION ${CMAKE_INSTALL_DATADIR}/patina/shaders COMPONENT documents
  FILES_MATCHING PATTERN "*.core" PATTERN "*.glsl" PATTERN "*.hlsl")
install(FILES README.md CHANGELOG.md LICENSE formats/FORMATS.md formats/ENGINE.md deploy/RUNBOOK.md
  DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT documents)
install(DIRECTORY deploy/examples deploy/reverse-proxy deploy/prometheus DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT documents
  PATTERN "__pycache__" EXCLUDE)

# ---- find_package(patina) ----
# patina::decoder: headers alone, for renderers: <patina/patina_decoder.h>, <patina/patina_brdf_decoder.h>.
# patina::formats: reads and writes every file of a container: "formats/container.h", "formats/manifest.h", ...
add_library(patina_decoder INTERFACE)
target_compile_features(patina_decoder INTERFACE cxx_std_17)
target_include_directories(patina_decoder INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
target_link_libraries(patina_decoder INTERFACE nlohmann_json::nlohmann_json)
set_target_properties(patina_decoder PROPERTIES EXPORT_NAME decoder)
target_compile_features(patina_formats PUBLIC cxx_std_20)
target_include_directories(patina_formats PUBLIC
  $<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/patina>)
set_target_properties(patina_formats PROPERTIES EXPORT_NAME formats)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/patina)
install(DIRECTORY formats/decoder/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/patina COMPONENT decoder
  FILES_MATCHING PATTERN "*.h")
install(TARGETS patina_decoder EXPORT patina_decoder_targets COMPONENT decoder)
install(EXPORT patina_decoder_targets NAMESPACE patina:: FILE patina-decoder.cmake DESTINATION ${package_dir}
  COMPONENT decoder)
configure_package_config_file(deploy/docs/patina-config.cmake.in ${CMAKE_BINARY_DIR}/cmake/patina-config.cmake
  INSTALL_DESTINATION ${package_dir} NO_SET_AND_CHECK_MACRO)
# Before 1.0 a minor version may break what is in these headers.
write_basic_package_version_file(${CMAKE_BINARY_DIR}/cmake/patina-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/cmake/patina-config.cmake ${CMAKE_BINARY_DIR}/cmake/patina-config-version.cmake
  DESTINATION ${package_dir} COMPONENT decoder)

install(TARGETS patina_formats EXPORT patina_formats_targets ARCHIVE COMPONENT formats)
install(EXPORT patina_formats_targets NAMESPACE patina:: FILE patina-formats.cmake DESTINATION ${package_dir}
  COMPONENT formats)
install(DIRECTORY formats/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/patina/formats COMPONENT formats
  FILES_MATCHING PATTERN "*.h" PATTERN decoder EXCLUDE PATTERN brdf EXCLUDE
  # What is between the library's own sources.
  PATTERN "embedded_*" EXCLUDE PATTERN manifest_json.h EXCLUDE PATTERN scene_json.h EXCLUDE PATTERN scene_reading.h EXCLUDE
  PATTERN shader_build.h EXCLUDE PATTERN shader_text.h EXCLUDE)
# The one header that both have, under both names: a second copy would be a second definition.
file(WRITE ${CMAKE_BINARY_DIR}/cmake/patina_brdf_sampler.h
  "#pragma once\n#include \"../../patina_brdf_sampler.h\"\n")
install(FILES ${CMAKE_BINARY_DIR}/cmake/patina_brdf_sampler.h
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/patina/formats/decoder COMPONENT formats)
