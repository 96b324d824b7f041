// The one dialect of the pages and of their tests; scripts/lint_pages.sh runs it. Where lines break
// and what stands between braces is clang-format's, as in C++.

import js from '@eslint/js';
import stylistic from '@stylistic/eslint-plugin';
import globals from 'globals';

// Fields of what the server sends and takes, of files and of the shaders are called as there.
const kNamesFromOutside = [
  'front_only',
  'image_name',
  'min_picks',
  'num_levels',
  'other_places',
  'rms_px',
  'scan_share',
  'tile_size',
];

export default [
  {
    files: ['**/*.js', '**/*.mjs'],
    languageOptions: {ecmaVersion: 2022, sourceType: 'module', globals: globals.browser},
    linterOptions: {reportUnusedDisableDirectives: 'error'},
    plugins: {'@stylistic': stylistic},
    rules: {
      ...js.configs.recommended.rules,
      '@stylistic/quotes': ['error', 'single', {avoidEscape: true}],
      '@stylistic/semi': 'error',
      'camelcase': ['error', {allow: kNamesFromOutside}],
      'curly': ['error', 'multi-line', 'consistent'],
      'eqeqeq': 'error',
      'no-shadow': 'error',
      'no-var': 'error',
      'object-shorthand': 'error',
      'prefer-arrow-callback': 'error',
      'prefer-const': 'error',
    },
  },
  {
    // Functions that page.evaluate() runs see the page's globals.
    files: ['tests/browser/*.mjs'],
    languageOptions: {globals: {...globals.node, roomtexView: 'readonly'}},
  },
];
