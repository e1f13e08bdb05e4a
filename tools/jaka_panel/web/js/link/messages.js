/**
 * Shapes of what page and server say to each other, for the type checker; docs/panel.md describes them.
 * SI units: m, rad, s; rotations are rotation vectors. null: not known.
 */

/**
 * @typedef {object} JointLimits
 * @property {string} name
 * @property {number} lower rad
 * @property {number} upper rad
 * @property {number} velocity rad/s
 */

/**
 * @typedef {object} ArmInfo
 * @property {string} id Name of the driver's node.
 * @property {string} label
 * @property {boolean} alive
 * @property {boolean|null} simulated
 * @property {string|null} model
 * @property {string} [controller]
 * @property {string} prefix
 * @property {JointLimits[]|null} joints
 * @property {{base: string, flange: string, tool: string}} frames
 * @property {Record<string, boolean>} has
 * @property {boolean} simulator
 * @property {{joint: number, linear: number, angular: number}} jog rad/s, m/s, rad/s at the full jog speed.
 * @property {string|null} description Changes when the robot description does.
 * @property {number|null} [zones] Changes when the zones of the motion guard do; null where they cannot be asked for.
 */

/**
 * @typedef {object} ToolPose
 * @property {number[]} p m
 * @property {number[]} r rad
 * @property {string} frame
 * @property {number|null} [age] s
 * @property {{p: number[], r: number[]}|null} [base] The same in the base frame.
 */

/**
 * @typedef {object} ArmState
 * @property {string} arm
 * @property {number} n
 * @property {number} now Server's clock, s.
 * @property {number|null} age s
 * @property {boolean} fresh
 * @property {number[]|null} q rad
 * @property {number[]|null} dq rad/s
 * @property {ToolPose|null} tool
 * @property {{motion: number, power: number, servo: number, collision: number, age: number|null}|null} robot
 * @property {Record<string, any>|null} status
 * @property {string|null} owner
 * @property {boolean|null} enabled
 * @property {boolean|null} hand_guiding
 * @property {number|null} tool_id
 * @property {number|null} user_id
 * @property {string} held_by
 * @property {number|null} speed 0 to 1
 * @property {{q: number[], e: number[], age: number|null}|null} want
 * @property {{f: number[], t: number[], age: number|null}|null} wrench N, N m
 * @property {number[]|null} temperature deg C
 * @property {number[]|null} current A
 */

/**
 * @typedef {object} Alarm
 * @property {number} n
 * @property {number} wall Unix time, s.
 * @property {number|null} until
 * @property {'error'|'warning'|'info'} level
 * @property {string|null} code
 * @property {string} text
 * @property {'controller'|'driver'|'panel'} source
 */

/**
 * @typedef {object} Call
 * @property {number} n
 * @property {number} wall Unix time, s.
 * @property {string} name
 * @property {string} caller
 * @property {string} request
 * @property {string} answer
 * @property {number} took s
 * @property {boolean} ok
 * @property {string} error
 */

/**
 * @typedef {object} Move
 * @property {number} n
 * @property {number} s Its begin, by the server's clock, s.
 * @property {number|null} to Its end; null while it goes on.
 * @property {string} owner In the driver's words; empty where it is not known.
 * @property {boolean} lost Samples ceased before its end.
 */

/**
 * @typedef {object} IoBank
 * @property {boolean[]} [di]
 * @property {boolean[]} [do]
 * @property {number[]} [ai]
 * @property {number[]} [ao]
 */

/**
 * @typedef {object} ControlState
 * @property {{page: string, name: string}|null} holder
 * @property {boolean} you
 * @property {{page: string, name: string, until: number}|null} asked
 */

/**
 * @typedef {object} Answer
 * @property {boolean} ok
 * @property {string} message
 * @property {any} [data]
 * @property {number} [took] s
 * @property {number} [now] Of a stop: when it was served, by the server's clock, s.
 * @property {boolean} [pending]
 */

/**
 * @typedef {object} Plan
 * @property {string} plan
 * @property {number} duration s
 * @property {number[]} start rad
 * @property {number[]} end rad
 * @property {number[][]} path rad
 * @property {number[]} t s
 * @property {string[]} warnings
 */

export {};
