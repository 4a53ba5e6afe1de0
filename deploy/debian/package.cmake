# The Debian package: `deploy/package` builds it. Maintainer scripts are beside this file.
find_program(PATINA_GIT git)
# Who builds the package answers for it.
foreach(what name email)
  set(packager_${what} "")
  if(PATINA_GIT)
    execute_process(COMMAND ${PATINA_GIT} config user.${what} WORKING_DIRECTORY ${CMAKE_SOURCE_DIR}
      OUTPUT_VARIABLE packager_${what} OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  endif()
endforeach()
if(NOT packager_name OR NOT packager_email)
  set(packager_name "Patina contributors")
  set(packager_email "patina@localhost")
endif()
set(PATINA_MAINTAINER "${packager_name} <${packager_email}>" CACHE STRING "Maintainer of the Debian package")

set(debian ${CMAKE_BINARY_DIR}/debian)
set(PATINA_DEB_VERSION ${PROJECT_VERSION}-1)
configure_file(deploy/debian/changelog.in ${debian}/changelog @ONLY)
set(PATINA_DEB_DOCS ${CMAKE_SOURCE_DIR}/deploy/debian/copyright ${debian}/changelog ${CMAKE_SOURCE_DIR}/CHANGELOG.md)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME patina)
set(CPACK_PACKAGE_VENDOR "Patina contributors")
set(CPACK_PACKAGE_DIRECTORY ${CMAKE_BINARY_DIR}/packages)
set(CPACK_STRIP_FILES ON)
# The configuration and the units lie outside the prefix.
set(CPACK_SET_DESTDIR ON)
set(CPACK_PRE_BUILD_SCRIPTS ${CMAKE_SOURCE_DIR}/deploy/debian/finish_tree.cmake)
set(CPACK_PATINA_DEB_DOCS "${PATINA_DEB_DOCS}")
set(CPACK_PATINA_DEB_PREFIX ${CMAKE_INSTALL_PREFIX})

set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "${PATINA_MAINTAINER}")
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "bakes PBR texture sets and BRDFs into small neural materials")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
"Patina takes a folder of PBR maps, a glTF scene or a measured BRDF and trains
a tiny neural material on CPU cores: four mipmapped BC6H textures, which GPUs
sample in hardware, and a network of a few hundred weights that fits in a
shader. The same input gives the same bytes on any number of threads.

This package has the command patina, the service patinad, which bakes what is
put into a drop folder, and for renderers the decoder's headers and shaders
and a static library that reads and writes containers.")
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# The maintainer scripts make the account and the folders; both work where no systemd runs.
set(CPACK_DEBIAN_PACKAGE_DEPENDS
  "systemd | systemd-standalone-sysusers, systemd | systemd-standalone-tmpfiles, init-system-helpers (>= 1.52)")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS
  "bash-completion, python3 (>= 3.11), python3-numpy, libssl-dev, libzstd-dev, libexpected-dev, nlohmann-json3-dev, nginx, prometheus")
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA
  ${CMAKE_SOURCE_DIR}/deploy/debian/conffiles ${CMAKE_SOURCE_DIR}/deploy/debian/postinst
  ${CMAKE_SOURCE_DIR}/deploy/debian/prerm ${CMAKE_SOURCE_DIR}/deploy/debian/postrm)
include(CPack)
