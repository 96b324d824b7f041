#!/usr/bin/env bash
# Checks the scripts of the pages and of their tests: one dialect of JavaScript, nothing unused or
# undefined (scripts/lint/eslint.config.mjs). ESLint comes in the versions that
# scripts/lint/package-lock.json pins, into the build folder. Changes nothing; --fix does.
set -euo pipefail
cd "$(dirname "$0")/.."

packages=build/npm/lint
if ! cmp -s scripts/lint/package-lock.json "$packages/installed"; then
  mkdir -p "$packages"
  cp scripts/lint/{package.json,package-lock.json,.npmrc} "$packages"
  (cd "$packages" && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error)
  cp scripts/lint/package-lock.json "$packages/installed"
fi
# Beside the packages, where the imports of the rules find them.
cp scripts/lint/eslint.config.mjs "$packages"
"$packages/node_modules/.bin/eslint" --config "$packages/eslint.config.mjs" --max-warnings 0 "$@" \
  align/pick/page texture/view/page building/window/page tests/browser scripts/lint
echo "the pages' scripts are in order"
