// A component for Unity that steps a world file. SoftBodyBehaviour.cs draws the bodies.
//
// No Unity has run this file. Mono's compiler has compiled it against stubs/UnityEngine.cs, and a test has run it so.
using System;
using System.IO;
using UnityEngine;

namespace TaichiSoft
{
    /// <summary>A world file of StreamingAssets, exported with `--axes unity`, that moves while this is enabled.</summary>
    // Before others, which may use World in their Start, and the impulses of a step in their FixedUpdate.
    [DefaultExecutionOrder(-100)]
    public sealed class SoftWorldBehaviour : MonoBehaviour
    {
        /// <summary>A collider or frame of the world file, and what it follows.</summary>
        [Serializable]
        public struct Follower
        {
            /// <summary>Its name in the world file.</summary>
            public string name;
            /// <summary>What it follows.</summary>
            public Transform target;
        }

        [SerializeField, Tooltip("Folder in StreamingAssets, written by: taichi-soft export --axes unity")]
        private string folder = "game.softworld";

        [SerializeField, Tooltip("Colliders that follow game objects")]
        private Follower[] colliders = new Follower[0];

        [SerializeField, Tooltip("Frames that follow game objects")]
        private Follower[] frames = new Follower[0];

        private readonly SoftEvent[] events = new SoftEvent[64]; // those from `toldCount` on are not told yet
        private EventKinds recorded;
        private int eventCount, toldCount;
        private int[] colliderNumbers, frameNumbers;
        private float fixedStep;
        private double ahead; // of the last step, put in by Update [s]

        /// <summary>What is in the file. Null before Awake and after OnDestroy.</summary>
        public Scene Scene { get; private set; }

        /// <summary>What moves. Null before Awake and after OnDestroy.</summary>
        public World World { get; private set; }

        /// <summary>Its time after the last call.</summary>
        public Clock Clock { get; private set; }

        /// <summary>A body touches a collider or another body. Told in Update, as all events are.</summary>
        /// <remarks>Kinds to which nobody listens are not recorded: listen in Start, before the first step.</remarks>
        public event Action<SoftEvent> ContactBegan;

        /// <summary>They touch no longer. Impulse is that of the whole contact, Duration how long it was.</summary>
        public event Action<SoftEvent> ContactEnded;

        /// <summary>A body lies still, and costs nothing.</summary>
        public event Action<SoftEvent> FellAsleep;

        /// <summary>It moves again.</summary>
        public event Action<SoftEvent> Woke;

        /// <summary>It could not be computed any further, and stays where it was.</summary>
        public event Action<SoftEvent> Froze;

        private void Awake()
        {
            Scene = new Scene(Path.Combine(Application.streamingAssetsPath, folder)); // compiles kernels: seconds
            World = new World(Scene);
            colliderNumbers = NumbersOf(NameKind.Collider, colliders);
            frameNumbers = NumbersOf(NameKind.Frame, frames);
        }

        private int[] NumbersOf(NameKind kind, Follower[] followers)
        {
            var numbers = new int[followers.Length];
            for (int i = 0; i < numbers.Length; ++i) numbers[i] = Scene.Find(kind, followers[i].name);
            return numbers;
        }

        // Unity calls this once a step, and Update once a frame. Update puts in the part of a step that the picture
        // is ahead of the last one, and this the rest: so each call of this makes one step, and alpha is right.
        private void FixedUpdate()
        {
            if (fixedStep != Time.fixedDeltaTime)
            {
                fixedStep = Time.fixedDeltaTime;
                World.SetFixedStep(fixedStep); // forgets what Update has put in
                ahead = 0;
            }
            Record();
            for (int i = 0; i < colliderNumbers.Length; ++i)
            {
                World.MoveCollider(colliderNumbers[i], PoseOf(colliders[i].target));
            }
            for (int i = 0; i < frameNumbers.Length; ++i)
            {
                World.MoveFrame(frameNumbers[i], PoseOf(frames[i].target));
            }
            Clock = World.Advance(fixedStep - ahead);
            ahead = 0;
        }

        private void Update()
        {
            if (fixedStep == 0) return; // no step yet
            double now = Math.Min((double)Time.time - Time.fixedTime, 0.999 * fixedStep);
            if (now > ahead)
            {
                Clock = World.Advance(now - ahead);
                ahead = now;
            }
            TellEvents();
        }

        private void Record()
        {
            EventKinds wanted = 0;
            if (ContactBegan != null) wanted |= EventKinds.ContactBegan;
            if (ContactEnded != null) wanted |= EventKinds.ContactEnded;
            if (FellAsleep != null) wanted |= EventKinds.FellAsleep;
            if (Woke != null) wanted |= EventKinds.Woke;
            if (Froze != null) wanted |= EventKinds.Froze;
            if (wanted == recorded) return;
            recorded = wanted; // what throws here does so once, and the world goes on
            World.RecordEvents(wanted);
        }

        // A listener may throw: then the rest is told in the next frame.
        private void TellEvents()
        {
            while (World != null) // a listener may end it
            {
                if (toldCount == eventCount)
                {
                    toldCount = 0;
                    eventCount = 0; // if the next line throws
                    eventCount = World.DrainEvents(events);
                    if (eventCount == 0) return;
                }
                SoftEvent next = events[toldCount++];
                Action<SoftEvent> listeners = ListenersTo(next.Kind);
                if (listeners != null) listeners(next);
            }
        }

        private Action<SoftEvent> ListenersTo(EventKinds kind)
        {
            switch (kind)
            {
                case EventKinds.ContactBegan: return ContactBegan;
                case EventKinds.ContactEnded: return ContactEnded;
                case EventKinds.FellAsleep: return FellAsleep;
                case EventKinds.Woke: return Woke;
                default: return Froze;
            }
        }

        private void OnDestroy()
        {
            if (World != null) World.Dispose();
            if (Scene != null) Scene.Dispose();
            World = null;
            Scene = null;
        }

        private static Pose PoseOf(Transform target)
        {
            Vector3 p = target.position;
            Quaternion r = target.rotation;
            return new Pose(new Vector3d(p.x, p.y, p.z), new Quaterniond(r.x, r.y, r.z, r.w));
        }
    }
}
