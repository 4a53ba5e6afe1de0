# Writes a C++ file with the text of schemas/openapi.json, and has CMake run again when that changes.
function(patina_embed_openapi output)
  set(source ${CMAKE_SOURCE_DIR}/schemas/openapi.json)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${source})
  file(READ ${source} text)
  # A compiler need not take literals of more than 64 KiB in one piece; adjacent ones are joined.
  string(CONCAT code "// Generated from schemas/openapi.json by embed_openapi.cmake.\n"
                     "#include \"daemon/api/openapi_text.h\"\n\nnamespace patina::daemon {\n\n"
                     "const char* const kOpenApiText =\n")
  string(LENGTH "${text}" length)
  set(at 0)
  while(at LESS length)
    string(SUBSTRING "${text}" ${at} 8000 piece)
    string(APPEND code "R\"OPENAPI(${piece})OPENAPI\"\n")
    math(EXPR at "${at} + 8000")
  endwhile()
  string(APPEND code ";\n\n}  // namespace patina::daemon\n")
  file(WRITE ${output}.new "${code}")
  file(COPY_FILE ${output}.new ${output} ONLY_IF_DIFFERENT)
endfunction()
