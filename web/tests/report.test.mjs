// The first screen of a report is the answer: the machine, when, what is left, a picture, and the sensors to look at.

import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { copyFileSync, mkdtempSync, readFileSync, rmSync, statSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { promisify } from "node:util";
import { browser, driven, pictures } from "./browser.mjs";
import { athermal } from "./service.mjs";

const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const run = promisify(execFile);
const readme = new URL("../../docs/report.png", import.meta.url).pathname;
const log = new URL("../../examples/logs/faults/log.csv", import.meta.url).pathname;

driven("the first screen of a report", () => {
  let folder, chromium;
  before(async () => {
    folder = mkdtempSync(join(tmpdir(), "athermal-report-"));
    const type = (...words) => run(athermal, words, { cwd: folder });
    copyFileSync(log, join(folder, "axis.csv"));
    await type("init", "axis.csv", "-o", "axis.toml");
    await type("fit", "axis.toml", "--data", "axis.csv", "--to", "2026-03-04", "-o", "model.json", "-q");
    await type("report", "model.json", "--data", "axis.csv", "--from", "2026-03-04", "-o", "report.html");
    chromium = await browser();
  });
  after(async () => {
    await chromium?.close();
    rmSync(folder, { recursive: true, force: true });
  });

  for (const [width, height] of [[1280, 800], [400, 800]]) {
    for (const colorScheme of ["light", "dark"]) {
      test(`at ${width} × ${height}, ${colorScheme}`, async (of) => {
        const context = await chromium.newContext({ viewport: { width, height }, colorScheme });
        const page = await context.newPage();
        const asked = [];
        page.on("request", (request) => asked.push(request.url()));
        await page.goto(`file://${join(folder, "report.html")}`);
        const seen = await page.evaluate((high) => {
          const all = [...document.querySelectorAll("h1, h1 ~ p, .verdicts li, .at-large svg.chart, .at-small svg.chart")];
          const inside = all.filter((of) => of.getClientRects().length && of.getBoundingClientRect().bottom <= high);
          return inside.map((of) => (of.tagName === "svg" ? `picture ${Math.round(of.getBoundingClientRect().width)}` : of.textContent));
        }, height);
        const text = seen.join("\n");
        const wanted = [/^axis$/m, /2026-03-04 00:00 to 2026-03-04 17:59 UTC/, /now\.Z.*left of [\d.]+ nm\/min: [\d.]+/, /stay within \d+ nm in \d+ % of cases, uncorrected \d+ %/];
        for (const expected of [...wanted, /Sensors to look at: temperature\.\w+/]) assert.match(text, expected);
        const drawn = seen.map((of) => /^picture (\d+)$/.exec(of)?.[1]).filter(Boolean);
        assert.equal(drawn.length, 1, "one picture");
        assert.ok(drawn[0] >= 0.85 * Math.min(width, 1100), `${drawn[0]} px of ${width}`);
        assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= width, "nothing goes beyond the edge");
        const scrolls = await page.evaluate(() => [...document.querySelectorAll(".wide.scrolls")].every((of) => getComputedStyle(of.nextElementSibling).display !== "none"));
        assert.ok(scrolls, "a table that scrolls says so");
        assert.ok(asked.every((url) => url.startsWith("file:") || url.startsWith("data:")), `${asked}`);
        await page.addScriptTag({ content: axe });
        const found = await page.evaluate(async () => (await window.axe.run()).violations.filter((of) => ["serious", "critical"].includes(of.impact)).map((of) => `${of.id}: ${of.nodes[0].html}`));
        assert.deepEqual(found, []);
        const file = join(pictures, `report-${width}-${colorScheme}.png`);
        await page.screenshot({ path: file });
        assert.ok(statSync(file).size > 20_000, `${file} shows something`);
        // The README shows this picture; pixels depend on fonts, and are not compared.
        const size_of = (path) => readFileSync(path).subarray(16, 24).toString("hex");
        if (width === 1280 && colorScheme === "light") assert.equal(size_of(readme), size_of(file), `${readme} has another size than ${file}`);
        of.diagnostic(file);
        await context.close();
      });
    }
  }
});
