"""Style of the report: one column on a phone, two on a screen, light and dark."""

from __future__ import annotations

from rig.ui.plots.inline_svg import colour_variables

LIGHT_PLOTS, DARK_PLOTS = colour_variables()

STYLE = f"""
:root {{
  color-scheme: light dark;
  --page: #fff; --card: #f6f7f9; --text: #1c1e21; --quiet: #5c636b; --line: #d5d9de;
  --link: #0b57d0; --good: #1a7f37; --doubtful: #9a6700; --bad: #c62828;
  {LIGHT_PLOTS};
}}
@media (prefers-color-scheme: dark) {{
  :root {{
    --page: #15171a; --card: #1e2125; --text: #e4e6e9; --quiet: #a2a9b1; --line: #3a3f45;
    --link: #8ab4f8; --good: #57c878; --doubtful: #e3b341; --bad: #ff8a80;
    {DARK_PLOTS};
  }}
}}
* {{ box-sizing: border-box }}
body {{
  margin: 0; background: var(--page); color: var(--text);
  font: 15px/1.45 system-ui, sans-serif; overflow-wrap: anywhere;
}}
main {{ max-width: 1180px; margin: 0 auto; padding: 20px }}
h1 {{ font-size: 24px; line-height: 1.25; margin: 0 0 4px }}
h2 {{ font-size: 16px; margin: 22px 0 6px }}
p, ul {{ margin: 6px 0 }}
a {{ color: var(--link) }}
.note {{ color: var(--quiet); font-size: 13px }}
.good {{ color: var(--good) }}
.doubtful {{ color: var(--doubtful) }}
.bad {{ color: var(--bad) }}
.columns {{ display: grid; grid-template-columns: minmax(0, 1fr); column-gap: 32px }}
@media (min-width: 900px) {{
  .columns {{ grid-template-columns: repeat(2, minmax(0, 1fr)) }}
  .columns.first {{ grid-template-columns: minmax(0, 4fr) minmax(0, 3fr) }}
}}
.scroll {{ overflow-x: auto }}
table {{
  border-collapse: collapse; width: 100%; font-size: 14px; font-variant-numeric: tabular-nums;
}}
th, td {{
  padding: 4px 0 4px 12px; border-bottom: 1px solid var(--line);
  text-align: right; vertical-align: baseline; overflow-wrap: normal;
}}
th {{ font-weight: 600 }}
th:first-child {{ padding-left: 0; text-align: left; font-weight: 400 }}
.facts td {{ text-align: left; overflow-wrap: anywhere }}
.facts th:first-child {{ color: var(--quiet); white-space: nowrap; width: 1% }}
pre {{
  margin: 4px 0 10px; padding: 8px 10px; background: var(--card); border-radius: 6px;
  font: 13px/1.45 ui-monospace, monospace; white-space: pre-wrap; overflow-wrap: anywhere;
}}
figure {{ margin: 0 0 12px; padding: 6px; background: var(--card); border-radius: 6px }}
figcaption {{ font-size: 13px; padding: 4px }}
svg {{ display: block; width: 100%; height: auto }}
svg text {{ font-family: system-ui, sans-serif !important; fill: var(--text) }}
@media (max-width: 600px) {{
  main {{ padding: 12px }}
  body {{ font-size: 14px }}
  h1 {{ font-size: 20px }}
  table {{ font-size: 12.5px }}
  th, td {{ padding-left: 8px }}
  figure {{ padding: 2px }}
  .ledger th[scope=col] {{ vertical-align: bottom }}
  .ledger th[scope=col]:not(:first-child) {{ writing-mode: vertical-rl; padding: 0 0 6px }}
}}
"""
