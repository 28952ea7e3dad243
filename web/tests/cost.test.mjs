// What a page costs whoever looks at it: 18 curves of 1,000 points at 10 Hz.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browser, driven, is_long, opened, until } from "./browser.mjs";
import { AXES, serve } from "./service.mjs";

/** Limits: ms to the first paint, the share of a core, bytes more on the heap than in its first third. */
const [PAINT_MS, SHARE, GROWTH] = [500, 0.1, 1_500_000];
const WATCHED_S = is_long ? 600 : 30;

driven("what a page costs", () => {
  let service, chromium, page, watch;
  before(async () => {
    [service, chromium] = await Promise.all([serve(), browser()]);
    // The first page of a browser starts it too.
    await (await opened(chromium, service.url)).context().close();
    page = await opened(chromium, service.url);
    watch = await page.context().newCDPSession(page);
    await watch.send("Performance.enable", { timeDomain: "threadTicks" });
  });
  after(async () => {
    await chromium?.close();
    await service?.stop();
  });

  const metrics = async () => Object.fromEntries((await watch.send("Performance.getMetrics")).metrics.map((of) => [of.name, of.value]));
  const heap = async () => {
    await watch.send("HeapProfiler.collectGarbage");
    return (await metrics()).JSHeapUsedSize;
  };

  test(`the first paint comes within ${PAINT_MS} ms`, async (of) => {
    const paint = await until("a paint", () => page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]?.startTime));
    of.diagnostic(`first paint after ${Math.round(paint)} ms`);
    assert.ok(paint <= PAINT_MS, `${paint} ms`);
  });

  test(`the main thread takes at most ${100 * SHARE} % of a core, and memory stays`, async (of) => {
    await page.getByRole("button", { name: "100 s" }).first().click();
    await page.getByRole("button", { name: "all", exact: true }).click();
    await until("all curves", async () => (await page.locator("section[aria-labelledby=drift] .entry").count()) === 3 * AXES.length);
    await page.locator("#drift").evaluate((of) => of.scrollIntoView());
    await page.evaluate(() => {
      window.strokes = 0;
      const stroke = CanvasRenderingContext2D.prototype.stroke;
      CanvasRenderingContext2D.prototype.stroke = function counted(path) {
        if (path) window.strokes += 1;
        return path ? stroke.call(this, path) : stroke.call(this);
      };
    });
    await new Promise((done) => setTimeout(done, 2000));
    const [first, strokes] = [await metrics(), await page.evaluate(() => window.strokes)];
    const heaps = [];
    const began = Date.now();
    for (let nth = 0; nth < 6; nth += 1) {
      await new Promise((done) => setTimeout(done, (WATCHED_S * 1000) / 6));
      heaps.push(await heap());
    }
    const last = await metrics();
    const passed = (Date.now() - began) / 1000;
    const share = (last.TaskDuration - first.TaskDuration) / passed;
    const drawn = ((await page.evaluate(() => window.strokes)) - strokes) / passed / (3 * AXES.length);
    const [early, late] = [Math.min(...heaps.slice(0, 2)), Math.min(...heaps.slice(-2))];
    of.diagnostic(`${(100 * share).toFixed(1)} % of a core over ${passed.toFixed(0)} s, each curve drawn ${drawn.toFixed(1)} times a second, heap ${heaps.map((size) => (size / 1e6).toFixed(1)).join(" ")} MB`);
    assert.ok(share <= SHARE, `${100 * share} %`);
    assert.ok(drawn > 0.9, "curves go on");
    assert.ok(late - early < GROWTH, `${late - early} bytes more`);
    assert.deepEqual(page.wrong, []);
  });
});
