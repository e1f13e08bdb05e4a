// Validates a CycloneDX file, JSON, against the strict schema of its version, and says how many components it has.
import { readFileSync } from 'node:fs';
import { Spec, Validation } from '@cyclonedx/cyclonedx-library';

const [path] = process.argv.slice(2);
const text = readFileSync(path, 'utf8');
const bom = JSON.parse(text);
const problems = await new Validation.JsonStrictValidator(Spec.Version[`v${bom.specVersion.replace('.', 'dot')}`]).validate(text);
if (problems !== null) {
  console.error(`${path}: not valid`, JSON.stringify(problems, null, 2));
  process.exit(1);
}
if (!(bom.components?.length > 0)) {
  console.error(`${path}: has no components`);
  process.exit(1);
}
console.log(`${path}: valid CycloneDX ${bom.specVersion}, ${bom.components.length} components`);
