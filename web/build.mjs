// Writes the page that the program serves: `npm ci && npm run build`. The same sources give the same bytes.
import { build } from "esbuild";
import { copyFile, mkdir, readFile } from "node:fs/promises";
import { gzipSync } from "node:zlib";
import { fileURLToPath } from "node:url";
import { join } from "node:path";

const here = fileURLToPath(new URL(".", import.meta.url));
const dist = process.argv[2] ?? join(here, "../plugins/beside/page/dist");
/** How many bytes the three files may have, packed. */
const MOST = 60_000;

await mkdir(dist, { recursive: true });
await build({
  absWorkingDir: here,
  entryPoints: [{ in: "src/page.jsx", out: "page" }, { in: "src/style/page.css", out: "page" }],
  outdir: dist,
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "utf8",
  jsx: "automatic",
  jsxImportSource: "preact",
  legalComments: "eof",
  logLevel: "warning",
});
await copyFile(join(here, "src/index.html"), join(dist, "index.html"));

let sum = 0;
for (const name of ["index.html", "page.js", "page.css"]) {
  const bytes = await readFile(join(dist, name));
  const packed = gzipSync(bytes, { level: 9 }).length;
  sum += packed;
  console.log(`${name.padEnd(12)}${bytes.length} bytes, ${packed} packed`);
}
console.log(`sum         ${sum} packed, of ${MOST}`);
if (sum > MOST) {
  console.error(`the page has ${sum} bytes, packed, and may have ${MOST}: take something out of web/src`);
  process.exit(1);
}
