# Libraries, commands and tests: what every target of a kind has in common.

# What most files include is parsed once. A header must still include what it uses: who links the installed
# libraries has no precompiled headers (docs/examples is built that way in a test).
file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/generated/precompiled.cc CONTENT "")
set(precompiled_headers
    <algorithm> <array> <cmath> <cstdint> <functional> <limits> <map> <memory> <optional> <set> <string>
    <utility> <vector> <Eigen/Core> <Eigen/Geometry> <Eigen/LU> <nlohmann/json.hpp>
    <opencv2/core.hpp>)
function(roomtex_precompiled name)
  add_library(${name} STATIC ${CMAKE_BINARY_DIR}/generated/precompiled.cc)
  target_link_libraries(${name} PRIVATE Eigen3::Eigen nlohmann_json::nlohmann_json opencv_core Threads::Threads)
  target_include_directories(${name} SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
  target_precompile_headers(${name} PRIVATE ${precompiled_headers} ${ARGN})
endfunction()
roomtex_precompiled(roomtex_precompiled)
# Tests are compiled more often than they run: a third of the time goes into optimising them. What is looked at under
# sanitizers is the code that they call.
set(roomtex_test_options ${roomtex_warnings} -O1 -fno-sanitize=all)

# roomtex_library(NAME [INSTALLED] ROOMS folders... [EXCEPT files...] PUBLIC ... PRIVATE ...): every .cc of the
# rooms, apart from the mains of commands (roomtex_*.cc). INSTALLED: users may link it, see install.cmake.
function(roomtex_library name)
  cmake_parse_arguments(ARG "INSTALLED" "" "ROOMS;FILES;EXCEPT;PUBLIC;PRIVATE" ${ARGN})
  set(sources ${ARG_FILES})
  foreach(room ${ARG_ROOMS})
    file(GLOB found CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} ${room}/*.cc)
    list(FILTER found EXCLUDE REGEX "(^|/)roomtex_[a-z]+[.]cc$")
    list(APPEND sources ${found})
  endforeach()
  if(ARG_EXCEPT)
    list(REMOVE_ITEM sources ${ARG_EXCEPT})
  endif()
  add_library(roomtex_${name} STATIC ${sources})
  add_library(roomtex::${name} ALIAS roomtex_${name})
  target_include_directories(roomtex_${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
  target_compile_options(roomtex_${name} PRIVATE ${roomtex_warnings})
  target_link_libraries(roomtex_${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  target_precompile_headers(roomtex_${name} REUSE_FROM roomtex_precompiled)
  if(ARG_INSTALLED)
    roomtex_install_library(${name} ROOMS ${ARG_ROOMS} EXCEPT ${ARG_EXCEPT})
  endif()
endfunction()

# roomtex_program(NAME SOURCES files... LIBRARIES ...): a program that is not installed.
function(roomtex_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBRARIES" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_compile_options(${name} PRIVATE ${roomtex_warnings})
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES})
  target_precompile_headers(${name} REUSE_FROM roomtex_precompiled)
endfunction()

# roomtex_command(NAME SOURCE LIBRARIES...): the installed program roomtex-NAME.
function(roomtex_command name source)
  add_executable(roomtex-${name} ${source})
  target_compile_options(roomtex-${name} PRIVATE ${roomtex_warnings})
  target_link_libraries(roomtex-${name} PRIVATE ${ARGN})
  target_precompile_headers(roomtex-${name} REUSE_FROM roomtex_precompiled)
  install(TARGETS roomtex-${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR}
          COMPONENT commands)
endfunction()

# roomtex_test(NAME [WHOLE] [LABEL l] [SLOW tests...] SOURCES files... LIBRARIES ...): every suite of tests becomes a
# ctest of its own, labelled `unit` or l: what a suite sets up is paid once, and so is starting a program, which takes
# 0.1 s of processor for OpenCV and what comes with it. WHOLE: the program is one ctest, because its suites share a
# costly fixture or are short. SLOW: tests (SUITE.NAME) that vary what others hold and take long; NAME_slow runs them,
# labelled slow.
function(roomtex_test name)
  cmake_parse_arguments(ARG "WHOLE" "LABEL" "SLOW;SOURCES;LIBRARIES" ${ARGN})
  if(NOT ARG_LABEL)
    set(ARG_LABEL unit)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_compile_options(${name} PRIVATE ${roomtex_test_options})
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES} roomtex_test_support GTest::gmock
                        GTest::gtest_main)
  target_precompile_headers(${name} REUSE_FROM roomtex_precompiled_tests)
  string(JOIN ":" slow ${ARG_SLOW})
  if(ARG_SLOW)
    add_test(NAME ${name}_slow COMMAND ${name} --gtest_filter=${slow})
    # All of them: a name that is no test's must not pass for one. With an expression to pass by, ctest no longer asks
    # for the exit code: what fails says so, a fixture's set-up, too.
    list(LENGTH ARG_SLOW num_slow)
    set_tests_properties(${name}_slow PROPERTIES LABELS slow TIMEOUT 1500 PASS_REGULAR_EXPRESSION
                         "(PASSED |SKIPPED) ] ${num_slow} test" FAIL_REGULAR_EXPRESSION "FAILED")
  endif()
  if(ARG_WHOLE)
    add_test(NAME ${name} COMMAND ${name} --gtest_filter=-${slow})
    # Long ones first, also where ctest knows no times yet: none is then left for the end alone.
    set_tests_properties(${name} PROPERTIES LABELS ${ARG_LABEL} COST 40)
  else()
    roomtex_discover_suites(${name} ${ARG_LABEL} "${slow}")
  endif()
endfunction()

# A ctest for every suite of the test program `name`, which is asked for them once it is linked; without the tests of
# `slow` (SUITE.NAME:...).
function(roomtex_discover_suites name label slow)
  set(script ${PROJECT_SOURCE_DIR}/scripts/cmake/discover_suites.cmake)
  set(suites ${CMAKE_CURRENT_BINARY_DIR}/${name}_suites.cmake)
  add_custom_command(TARGET ${name} POST_BUILD
    COMMAND ${CMAKE_COMMAND} -D PROGRAM=$<TARGET_FILE:${name}> -D LABEL=${label} -D SLOW=${slow} -D OUTPUT=${suites}
            -P ${script}
    BYPRODUCTS ${suites} VERBATIM)
  # A program that was not built is a test that fails.
  file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/${name}_include.cmake
       "if(EXISTS \"${suites}\")\n  include(\"${suites}\")\nelse()\n  add_test(${name}_NOT_BUILT ${name}_NOT_BUILT)\n"
       "  set_tests_properties(${name}_NOT_BUILT PROPERTIES LABELS ${label})\nendif()\n")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${CMAKE_CURRENT_BINARY_DIR}/${name}_include.cmake)
endfunction()
