// Picture of the playground for the documents: `node photograph.mjs FOLDER OUT.png`. The README's example with its motor, after a gain was moved.
import { chromium } from "playwright-core";
import { serve } from "./serve.mjs";

/** Size in pixels of the page, and pixels of the picture for each. */
const VIEWPORT = { width: 1280, height: 800 }, RATIO = 1.5;
/** Slider that is moved, and where to, as a part of its range. */
const [EXAMPLE, SLIDER, TO] = ["gains.s", "ki, slider", 0.2];

const [folder, out] = process.argv.slice(2);
const { server, address } = await serve(folder);
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
const page = await browser.newPage({ viewport: VIEWPORT, deviceScaleFactor: RATIO, colorScheme: "light" });
const rests = () => page.waitForFunction(() => document.body.dataset.ready !== undefined && !document.getElementById("assemble").disabled && !takt.state.stale);
await page.goto(`${address}#example=${EXAMPLE}`);
await rests();
await page.waitForSelector(".hint");
await page.locator(`input[aria-label="${SLIDER}"]`).evaluate((slider, to) => {
  slider.value = to * slider.max;
  for (const kind of ["input", "change"]) slider.dispatchEvent(new Event(kind, { bubbles: true }));
}, TO);
await page.waitForSelector(".ghost");
await rests();
await page.screenshot({ path: out });
await browser.close();
server.close();
