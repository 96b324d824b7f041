#!/usr/bin/env bash
# No class, struct or enum has two definitions: programs that link both would break the one-definition rule without
# a word (the linker takes one of the two). Looks at namespace scope, where definitions start in the first column,
# and leaves out what an anonymous namespace of a .cc keeps to itself.
set -euo pipefail
cd "$(dirname "$0")/.."

definitions() {
  find core colmap_ext importers align texture building capture dense workflow -name '*.h' -o -name '*.cc' | sort | xargs awk '
    FNR == 1 { anonymous = 0 }
    /^namespace \{/ { anonymous = 1 }
    /^\}  \/\/ namespace$/ { anonymous = 0 }
    !anonymous && match($0, /^(class|struct|union|enum( class)?) [A-Za-z0-9_:]+/) && !/;$/ {
      split(substr($0, RSTART, RLENGTH), words, " ")
      print words[length(words)], FILENAME ":" FNR
    }'
}
twice=$(definitions | sort | awk '
  $1 == name { if (first != "") print name ": " first; first = ""; print name ": " $2; next }
  { name = $1; first = $2 }')
if [ -n "$twice" ]; then
  printf 'Defined more than once:\n%s\n' "$twice"
  exit 1
fi
echo "Every class, struct and enum is defined once."
