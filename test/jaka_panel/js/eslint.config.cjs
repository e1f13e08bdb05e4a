// Run from the checkout with NODE_PATH=build/js/node_modules, where tools/dev puts the linter.
const js = require('@eslint/js');
const globals = require('globals');

module.exports = [
  { ignores: ['**/vendor/**'] },
  js.configs.recommended,
  {
    files: ['tools/jaka_panel/web/**/*.js'],
    languageOptions: { ecmaVersion: 2023, sourceType: 'module', globals: globals.browser },
  },
  {
    files: ['test/jaka_panel/js/**/*.js'],
    languageOptions: { ecmaVersion: 2023, sourceType: 'module', globals: { ...globals.node } },
  },
  {
    rules: {
      'no-restricted-properties': ['error', ...['innerHTML', 'outerHTML', 'insertAdjacentHTML', 'write'].map((property) => (
        { property, object: property === 'write' ? 'document' : undefined, message: 'Foreign text must stay text.' }))],
      'no-restricted-globals': ['error', 'eval', 'Function', 'setImmediate'],
      'no-eval': 'error',
      'no-implied-eval': 'error',
      'no-new-func': 'error',
      'no-var': 'error',
      'prefer-const': 'error',
      eqeqeq: 'error',
      'no-unused-vars': ['error', { argsIgnorePattern: '^_', caughtErrors: 'none' }],
    },
  },
];
