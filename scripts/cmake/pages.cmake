# Web pages that are built into a program, and the npm packages that they and the browser tests need.

# roomtex_page(TARGET pick FILES...): builds the files of a web page into TARGET, which includes
# "pick_page.h" and hands kPickPage to AddPage() (core/page.h). A file is reachable under its own
# name without folders; theme.css, the look that all pages share, comes with them.
function(roomtex_page target name)
  string(SUBSTRING ${name} 0 1 initial)
  string(TOUPPER ${initial} initial)
  string(SUBSTRING ${name} 1 -1 rest)
  set(variable k${initial}${rest}Page)
  set(folder ${CMAKE_CURRENT_BINARY_DIR}/${name}_page)
  set(symbols "")
  set(entries "")
  set(index 0)
  foreach(file ${ARGN} ${CMAKE_SOURCE_DIR}/core/page/theme.css)
    get_filename_component(path ${file} ABSOLUTE)
    get_filename_component(short ${file} NAME)
    set(symbol roomtex_${name}_page_${index})
    # The assembler takes the file as it is; an array of numbers would take the compiler seconds.
    string(APPEND symbols "asm(\".section .rodata\\n${symbol}:\\n.incbin \\\"${path}\\\"\\n${symbol}_end:\\n.previous\\n\");\n"
                          "extern \"C\" const char ${symbol}[], ${symbol}_end[];\n")
    string(APPEND entries "    {\"${short}\", {${symbol}, static_cast<size_t>(${symbol}_end - ${symbol})}},\n")
    list(APPEND paths ${path})
    math(EXPR index "${index} + 1")
  endforeach()
  file(CONFIGURE OUTPUT ${folder}/${name}_page.h @ONLY CONTENT
       "#pragma once\n#include \"core/page.h\"\nnamespace roomtex {\nextern const Page ${variable};\n}\n")
  file(CONFIGURE OUTPUT ${folder}/${name}_page.cc @ONLY CONTENT
       "#include \"${name}_page.h\"\n${symbols}namespace roomtex {\nconst Page ${variable} = {\n${entries}};\n}\n")
  # A unity file would not know what it depends on.
  set_source_files_properties(${folder}/${name}_page.cc
    PROPERTIES OBJECT_DEPENDS "${paths}" SKIP_UNITY_BUILD_INCLUSION ON)
  target_sources(${target} PRIVATE ${folder}/${name}_page.cc)
  target_include_directories(${target} PRIVATE ${folder})
endfunction()

# roomtex_npm(FOLDER): installs the packages that FOLDER/package-lock.json pins, at build time and into the
# build folder; sets ROOMTEX_NPM_DIR to it. What needs them depends on ${ROOMTEX_NPM_DIR}/installed.
function(roomtex_npm folder)
  find_program(NPM npm REQUIRED)
  get_filename_component(path ${folder} ABSOLUTE)
  file(RELATIVE_PATH below ${PROJECT_SOURCE_DIR} ${path})
  set(build ${CMAKE_BINARY_DIR}/npm/${below})
  add_custom_command(
    OUTPUT ${build}/installed
    COMMAND ${CMAKE_COMMAND} -E make_directory ${build}
    COMMAND ${CMAKE_COMMAND} -E copy ${path}/package.json ${path}/package-lock.json ${build}
    COMMAND ${CMAKE_COMMAND} -E chdir ${build}
            ${NPM} ci --ignore-scripts --no-audit --no-fund --loglevel=error
    COMMAND ${CMAKE_COMMAND} -E touch ${build}/installed
    DEPENDS ${path}/package-lock.json
    COMMENT "Installing the packages of ${below}/package-lock.json")
  set(ROOMTEX_NPM_DIR ${build} PARENT_SCOPE)
endfunction()
