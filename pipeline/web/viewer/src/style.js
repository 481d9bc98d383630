// A constructed style sheet: it needs neither a file beside the bundle nor inline styles in the page.
const STYLE = `
.w3d { container-type: inline-size; position: relative; width: 100%; height: 100%; min-height: 240px; overflow: hidden; background: #f3f5f7;
  font: 13px/1.35 system-ui, sans-serif; color: #16202a; touch-action: none; }
.w3d-none { display: grid; place-content: center; padding: 2rem; text-align: center; }
.w3d canvas { display: block; width: 100%; height: 100%; outline: none; cursor: grab; }
.w3d canvas:active { cursor: grabbing; }
.w3d canvas:focus-visible { box-shadow: inset 0 0 0 3px #0b62c4; }
.w3d canvas:focus-visible { outline: 3px solid #0b62c4; outline-offset: -3px; }
.w3d-labels { position: absolute; inset: 0; overflow: hidden; pointer-events: none; }
.w3d-labels[hidden] { display: none; }
.w3d-label { position: absolute; left: 0; top: 0; min-width: 26px; min-height: 26px; box-sizing: border-box; padding: 3px 7px; border: 1px solid #9aa7b4; border-radius: 5px;
  background: #ffffffd9; color: #16202a; font: inherit; text-align: left; white-space: nowrap;
  font-variant-numeric: tabular-nums; }
.w3d-label[hidden] { display: none; }
span.w3d-label { border: 0; background: #ffffffb0; min-width: 0; min-height: 0; padding: 0 4px; }
button.w3d-label { pointer-events: auto; cursor: pointer; }
button.w3d-label:hover { background: #fff; border-color: #0b62c4; color: #16202a; }
button.w3d-label[aria-pressed="true"] { background: #fff4d6; border-color: #8a5a00; box-shadow: 0 0 0 1px #8a5a00; color: #16202a; }
.w3d-label > span { display: block; font-size: 12px; }
.w3d-brief:not(:hover, :focus-visible, [aria-pressed="true"]) > span { display: none; }
button.w3d-label:is(:hover, :focus-visible, [aria-pressed="true"]) { z-index: 1; }
.w3d-bad { border-color: #c43302; color: #8f2500; }
.w3d-bar { position: absolute; display: flex; flex-wrap: wrap; gap: 2px 4px; padding: 4px; border-radius: 7px;
  background: #ffffffe6; box-shadow: 0 1px 3px #0003; z-index: 20000; }
.w3d-head { position: absolute; inset: 8px; display: flex; flex-direction: column; align-items: flex-start; gap: 6px; pointer-events: none; z-index: 20001; }
.w3d-head > * { position: static; pointer-events: auto; }
.w3d-foot { position: absolute; left: 8px; right: 8px; bottom: 8px; display: flex; flex-direction: column; align-items: flex-start;
  gap: 6px; pointer-events: none; }
.w3d-foot > * { position: static; pointer-events: auto; max-width: 100%; box-sizing: border-box; }
.w3d-count { flex-basis: 100%; margin: 0; padding: 0 6px; font-size: 12px; }
.w3d-scale { flex-direction: column; align-items: stretch; width: 270px; font-size: 12px; padding: 4px 8px; }
.w3d-scale i { height: 11px; border-radius: 2px; }
.w3d-scale > span:last-child { display: flex; justify-content: space-between; }
.w3d-scale b { font-weight: 400; font-variant-numeric: tabular-nums; }
.w3d-panel { align-self: flex-end; width: 260px; max-width: 100%; min-height: 0; box-sizing: border-box; overflow: auto;
  flex-flow: column nowrap; gap: 6px; padding: 8px; background: #fff; }
.w3d-panel > * { flex: none; }
.w3d-panel fieldset { border: 1px solid #c3ccd5; border-radius: 5px; margin: 0; padding: 4px 6px; min-width: 0; }
.w3d-panel legend { padding: 0 4px; font-weight: 600; }
.w3d-ticks { display: flex; flex-wrap: wrap; gap: 2px 6px; }
.w3d-panel label { padding: 3px 0; min-height: 24px; box-sizing: border-box; }
.w3d-panel select { flex: 1; min-width: 0; width: 8rem; min-height: 26px; font: inherit; color: inherit; background: #fff; border: 1px solid #7a8794; border-radius: 4px; }
.w3d-panel label:has(select) { width: 100%; }
.w3d-panel p { margin: 0; }
.w3d-panel input[type=range] { flex: 1; min-width: 0; min-height: 24px; }
.w3d-panel output { font-variant-numeric: tabular-nums; }
.w3d-rest { display: flex; flex-wrap: wrap; gap: 2px 8px; align-items: center; }
.w3d-said { font-weight: 600; font-variant-numeric: tabular-nums; }
.w3d-patch { width: 10px; height: 10px; border-radius: 2px; }
.w3d-bar button[aria-pressed="true"], .w3d-bar button[aria-expanded="true"] { background: #d5e3f2; }
.w3d-bar [hidden], .w3d-bar[hidden] { display: none; }
.w3d-bar button { padding: 4px 9px; border: 1px solid transparent; border-radius: 5px; background: none; color: inherit;
  font: inherit; cursor: pointer; }
.w3d-bar button:hover { background: #e3eaf1; }
.w3d-bar label { display: flex; align-items: center; gap: 4px; padding: 3px 6px; cursor: pointer; }
.w3d-bar input { margin: 0; accent-color: #0b62c4; }
.w3d :is(button, input, select):focus-visible { outline: 3px solid #0b62c4; outline-offset: 1px; }
@container (max-width: 480px) {
  .w3d-layers > .w3d-ticks { flex-wrap: nowrap; overflow-x: auto; white-space: nowrap; }
  .w3d-layers label { flex: none; }
}
@media print { .w3d-bar { display: none; } }
`;
let adopted = false;

export function adoptStyle() {
  if (adopted) return;
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(STYLE);
  document.adoptedStyleSheets = [...document.adoptedStyleSheets, sheet];
  adopted = true;
}
