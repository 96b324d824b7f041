# Run after PROGRAM was linked: asks it for its test suites and writes OUTPUT, which ctest includes: a test per suite,
# without the tests of SLOW (SUITE.NAME:...).
execute_process(COMMAND ${PROGRAM} --gtest_list_tests OUTPUT_VARIABLE listed RESULT_VARIABLE result TIMEOUT 60)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "${PROGRAM} --gtest_list_tests: ${result}")
endif()
# Suites stand at the beginning of a line and end with a point; typed ones have a comment behind.
string(REGEX MATCHALL "(^|\n)[A-Za-z0-9_/]+[.]" suites "${listed}")
list(TRANSFORM suites STRIP)
set(script "")
foreach(suite ${suites})
  string(REGEX REPLACE "[.]$" "" name "${suite}")
  if(NOT name MATCHES "(^|/)DISABLED_")
    string(APPEND script "add_test([==[${name}]==] \"${PROGRAM}\" [==[--gtest_filter=${suite}*-${SLOW}]==])\n"
                         "set_tests_properties([==[${name}]==] PROPERTIES LABELS ${LABEL})\n")
  endif()
endforeach()
if(script STREQUAL "")
  message(FATAL_ERROR "${PROGRAM} has no tests.")
endif()
file(WRITE ${OUTPUT} "${script}")
