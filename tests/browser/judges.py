"""Checks of a page, as JavaScript that returns what is wrong."""

from __future__ import annotations

LOW_CONTRAST = """() => {
  const canvas = Object.assign(document.createElement("canvas"), { width: 1, height: 1 });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  const rgba = (css) => {
    context.clearRect(0, 0, 1, 1);
    context.fillStyle = css;
    context.fillRect(0, 0, 1, 1);
    return [...context.getImageData(0, 0, 1, 1).data].map((v) => v / 255);
  };
  const over = ([r, g, b, a], under) => [r, g, b].map((v, i) => v * a + under[i] * (1 - a));
  const ground = (node) => {
    if (!node) return [1, 1, 1];
    return over(rgba(getComputedStyle(node).backgroundColor), ground(node.parentElement));
  };
  const light = (rgb) => {
    const [r, g, b] = rgb.map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const isRead = (node) => [...node.childNodes].some((child) => child.nodeType === 3 && child.textContent.trim())
    && node.checkVisibility({ visibilityProperty: true }) && !node.closest("noscript, :disabled, option");
  const found = [];
  for (const node of [...document.body.querySelectorAll("*")].filter(isRead)) {
    const style = getComputedStyle(node), under = ground(node), size = parseFloat(style.fontSize);
    const [one, two] = [light(over(rgba(style.color), under)), light(under)].sort((a, b) => b - a);
    const isLarge = size >= 24 || (size >= 18.6 && Number(style.fontWeight) >= 700);
    const ratio = (one + 0.05) / (two + 0.05);
    const words = `${node.className || node.tagName}: ${node.textContent.trim().slice(0, 30)}`;
    if (ratio < (isLarge ? 3 : 4.5)) found.push(`${ratio.toFixed(2)} ${words}`);
  }
  return found;
}"""
"""Texts whose contrast is below WCAG 2.2 AA: 4.5, or 3 for large text."""

SMALL_TARGETS = """() => [...document.querySelectorAll("button, select, input:not([type=checkbox]), summary")]
  .filter((node) => node.checkVisibility({ visibilityProperty: true }) && !node.disabled)
  .map((node) => [node, node.getBoundingClientRect()])
  .filter(([, box]) => box.width > 0 && box.height < 40)
  .map(([node, { width, height }]) => `${Math.round(width)}×${Math.round(height)} ${node.id || node.outerHTML}`)"""
"""Controls that are too small for a finger."""
