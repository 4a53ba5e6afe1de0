# Run by cpack on the installed tree: what Debian's policy wants otherwise than `cmake --install` does.
set(tree "${CPACK_TEMPORARY_INSTALL_DIRECTORY}")
set(share "${tree}${CPACK_PATINA_DEB_PREFIX}/share")
if(NOT IS_DIRECTORY "${share}/doc/patina")
  message(FATAL_ERROR "finish_tree: there is no installed tree in ${tree}")
endif()

list(GET CPACK_PATINA_DEB_DOCS 0 copyright)
list(GET CPACK_PATINA_DEB_DOCS 1 changelog)
list(GET CPACK_PATINA_DEB_DOCS 2 upstream)
file(COPY_FILE "${copyright}" "${share}/doc/patina/copyright")
file(COPY_FILE "${changelog}" "${share}/doc/patina/changelog.Debian")
file(COPY_FILE "${upstream}" "${share}/doc/patina/changelog")
file(REMOVE "${share}/doc/patina/LICENSE" "${share}/doc/patina/CHANGELOG.md")

file(GLOB pages "${share}/man/man*/*.[158]")
if(NOT pages)
  message(FATAL_ERROR "finish_tree: there are no manual pages in ${share}/man")
endif()
foreach(page ${pages} "${share}/doc/patina/changelog.Debian" "${share}/doc/patina/changelog")
  execute_process(COMMAND gzip -9nf "${page}" COMMAND_ERROR_IS_FATAL ANY)
endforeach()

# Whatever the umask was of whoever builds.
execute_process(COMMAND chmod -R u=rwX,go=rX "${tree}" COMMAND_ERROR_IS_FATAL ANY)
